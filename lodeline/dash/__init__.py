"""The page: a small gateway on this machine that shows a running pipeline in a browser.

`link` follows the pipeline on the bus, `scene` and `frames` say what of it the page gets, `web`
decides who may ask, `gateway` serves; `page/` is what the browser loads.
"""
