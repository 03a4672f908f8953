"""Who may ask the gateway, and what files a browser gets from it.

A page of a stranger can make the user's browser ask us: by our address (its Origin tells), or by
a name of its own that it lets point here (the Host tells). Both are refused.
"""

from __future__ import annotations

from http import HTTPStatus
from pathlib import Path

from websockets.datastructures import Headers
from websockets.http11 import Request, Response

PAGE = Path(__file__).with_name("page")
SOCKET = "/ws"
HOSTS = ("127.0.0.1", "localhost", "[::1]")
KINDS = {
    ".html": "text/html; charset=utf-8",
    ".css": "text/css; charset=utf-8",
    ".js": "text/javascript; charset=utf-8",
    ".svg": "image/svg+xml",
}
POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self'; "
    "connect-src 'self' ws://{host}; base-uri 'none'; form-action 'none'; "
    "frame-ancestors 'none'; require-trusted-types-for 'script'; trusted-types 'none'"
)
SAFE = {
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "DENY",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Permissions-Policy": "camera=(), geolocation=(), microphone=()",
    "Cache-Control": "no-store",
}


def answer(request: Request) -> Response | None:
    """The answer to a request, or None if it may go on to become a WebSocket."""
    hosts = request.headers.get_all("Host")
    if len(hosts) != 1 or not _is_ours(hosts[0]):
        return _words(HTTPStatus.FORBIDDEN, "this host name is not mine")
    origins = request.headers.get_all("Origin")
    wants_socket = request.path == SOCKET
    if origins != [f"http://{hosts[0]}"] and (origins or wants_socket):
        return _words(HTTPStatus.FORBIDDEN, "only my own page may ask")
    if request.method != "GET":
        return _words(HTTPStatus.METHOD_NOT_ALLOWED, "GET only")
    return None if wants_socket else _file(request.path, hosts[0])


def _is_ours(host: str) -> bool:
    """A loopback name; any port, for a tunnel may give us another one."""
    name, colon, port = host.rpartition(":")
    if not colon or host.endswith("]"):
        name, port = host, "80"
    return name in HOSTS and port.isascii() and port.isdigit()


def _file(path: str, host: str) -> Response:
    known = {f"/{file.name}": file for file in PAGE.iterdir() if file.suffix in KINDS}
    file = known.get("/index.html" if path == "/" else path)
    if file is None:
        return _words(HTTPStatus.NOT_FOUND, "no such file")
    return _response(HTTPStatus.OK, KINDS[file.suffix], file.read_bytes(), host)


def _words(status: HTTPStatus, text: str) -> Response:
    return _response(status, "text/plain; charset=utf-8", f"{text}\n".encode(), "127.0.0.1")


def _response(status: HTTPStatus, kind: str, body: bytes, host: str) -> Response:
    headers = Headers({"Content-Type": kind, "Content-Length": str(len(body)), **SAFE})
    headers["Content-Security-Policy"] = POLICY.format(host=host)
    headers["Connection"] = "close"
    return Response(status.value, status.phrase, headers, body)
