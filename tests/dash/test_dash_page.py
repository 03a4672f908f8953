"""Claims about the page, in a real browser over a real pipeline."""

from __future__ import annotations

import json
import math
import random
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from lodeline.rotation import from_euler
from lodeline.sessions import Client
from tests.dash.chromium import Chromium
from tests.dash.support import Dash, Ear
from tests.support.live import ROOT, Up, eventually

MINUS = "\u2212"
STATE = "document.documentElement?.dataset.state"
LIVE = f"{STATE} === 'live' && document.getElementById('x')?.textContent.length > 3"
SHOWN = """(() => {
  const text = (id) => document.getElementById(id).textContent;
  const {seq} = document.getElementById('pose').dataset;
  return [Number(seq), text('x'), text('y'), text('yaw'), text('bound')];
})()"""


def number(text: str) -> float:
    """A number as the page writes it."""
    return float(text.replace(MINUS, "-"))


# Labels of wires and boxes of nodes of which one covers another, by more than a hair.
COVERED = """(() => {
  const things = [...document.querySelectorAll('#graph g:not(.node) > text, #graph .box')]
    .filter((each) => each.matches('.box') || each.textContent.trim())
    .map((it) => [it.textContent || it.parentNode.dataset.node, it.getBoundingClientRect()]);
  const over = (a, b) => Math.min(a.right, b.right) - Math.max(a.left, b.left) > 2
    && Math.min(a.bottom, b.bottom) - Math.max(a.top, b.top) > 4;
  return things.flatMap(([name, box], i) => things.slice(i + 1)
    .filter(([, other]) => over(box, other)).map(([other]) => `${name} and ${other}`));
})()"""


@pytest.fixture
def page(chromium: Chromium, dash: Dash) -> Iterator[Chromium]:
    """The page, opened with its token; it must cause no error and no warning."""
    chromium.open(dash.url)
    assert chromium.comes_true(LIVE)
    yield chromium
    chromium.run("1")
    assert chromium.troubles == []


def test_the_pose_shown_is_the_one_that_zenoh_carried(page: Chromium, up: Up) -> None:
    ear = Ear(up, "pose")
    assert ear.hears("pose", lambda _: True, 30.0)
    compared: set[int] = set()
    deadline = time.monotonic() + 20.0
    while len(compared) < 10 and time.monotonic() < deadline:
        seq, x, y, yaw, bound = page.run(SHOWN)
        sent = ear.all("pose").get(seq)
        if sent is None:
            continue
        compared.add(seq)
        assert number(x) == pytest.approx(sent.x, abs=0.51e-4)
        assert number(y) == pytest.approx(sent.y, abs=0.51e-4)
        assert number(yaw) == pytest.approx(math.degrees(sent.yaw), abs=0.051)
        xx, xy, _, _, yy, *_ = sent.covariance
        major = (xx + yy) / 2 + math.hypot((xx - yy) / 2, xy)
        assert number(bound) == pytest.approx(1e3 * math.sqrt(5.991 * major), abs=0.051)
    ear.close()
    assert len(compared) >= 10


def test_error_and_tilt_are_shown(page: Chromium) -> None:
    assert page.comes_true("/^[\\d.]+$/.test(document.getElementById('error').textContent)")
    for name in ("roll", "pitch"):
        text = page.run(f"document.getElementById('{name}').textContent")
        assert abs(number(text)) < 20.0


def test_the_graph_shows_the_rates_and_ages_that_nodes_report(page: Chromium, dash: Dash) -> None:
    labels = "[...document.querySelectorAll('#graph g > text')].map((t) => t.textContent)"
    assert page.comes_true(f"{labels}.some((t) => /^imu\\/data_raw ?[12]\\d\\d Hz/.test(t))")
    texts = page.run(labels)
    keys = set(page.run("[...document.querySelectorAll('#graph .key')].map((t) => t.textContent)"))
    assert {"imu/data_raw", "wheels", "odom", "magnets", "pose", "truth", "cmd_vel"} <= keys
    assert any("ms" in text for text in texts)
    assert page.run(COVERED) == []
    nodes = page.run("[...document.querySelectorAll('#graph .node')].map((n) => n.dataset.node)")
    assert len(nodes) == 9
    assert len(page.run("[...document.querySelectorAll('#nodes tbody tr')].map(() => 1)")) == 9


def test_health_is_told_by_word_and_mark_not_by_colour_alone(page: Chromium) -> None:
    words = "[...document.querySelectorAll('#graph .word')].map((t) => t.textContent)"
    assert page.comes_true(f"{words}.length === 9 && {words}.every((t) => /^[●▲✕] [a-z]/.test(t))")


def test_map_and_plots_are_drawn(page: Chromium) -> None:
    ink = """(id) => {
      const canvas = document.querySelector(id);
      const data = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height).data;
      const seen = new Set();
      for (let i = 0; i < data.length; i += 4) if (data[i + 3]) {
        seen.add((data[i] << 16) | (data[i + 1] << 8) | data[i + 2]);
      }
      return seen.size;
    }"""
    for place in ("#map", "#closeup", "#horizon", "#compass"):
        assert page.comes_true(f"({ink})('{place}') > 5"), place
    # Curves, below the heading that has their colours too: 20 points of each plot at least.
    curves = """[...document.querySelectorAll('#plots canvas')].map((canvas) => {
      const style = getComputedStyle(document.documentElement);
      const names = ['ekf', 'odom', 'truth', 'hit', 'good', 'warn', 'bad'];
      const wanted = new Set(names.map((name) => style.getPropertyValue(`--${name}`).trim()));
      const top = Math.round(canvas.height / 4);
      const { width, height } = canvas;
      const data = canvas.getContext('2d').getImageData(0, top, width, height - top).data;
      let count = 0;
      for (let i = 0; i < data.length; i += 4) {
        const hex = [0, 1, 2].map((k) => data[i + k].toString(16).padStart(2, '0')).join('');
        if (data[i + 3] === 255 && wanted.has(`#${hex}`)) count += 1;
      }
      return count;
    })"""
    assert page.run("document.querySelectorAll('#plots canvas').length") == 8
    assert page.comes_true(f"{curves}.every((count) => count > 20)"), page.run(curves)


@pytest.mark.parametrize("size", [(1280, 720), (390, 844)])
def test_the_close_up_never_stays_over_the_robot(
    chromium: Chromium, dash: Dash, size: tuple[int, int]
) -> None:
    chromium.open(dash.url, *size)
    assert chromium.comes_true(LIVE)
    covered = chromium.run("""(async () => {
      const { CloseUp } = await import('./closeup.js');
      const canvas = document.getElementById('closeup');
      const map = document.getElementById('map').getBoundingClientRect();
      const glass = new CloseUp(canvas);
      const covered = [];
      for (let y = 10; y < map.height - 10; y += 7) for (let x = 10; x < map.width; x += 7) {
        glass.avoid([x, y]);
        const box = canvas.getBoundingClientRect();
        const [left, top] = [box.left - map.left, box.top - map.top];
        const within = x > left && x < left + box.width && y > top;
        if (within && y < top + box.height) covered.push([x, y]);
        if (top < 0 || top + box.height > map.height) covered.push(['out of the map', top]);
      }
      return covered;
    })()""")
    assert covered == []


def test_pause_stands_still_and_scrubbing_goes_back(page: Chromium, up: Up) -> None:
    ear = Ear(up, "pose")
    assert ear.hears("pose", lambda _: True, 30.0)
    enough = min(ear.all("pose")) + 350  # 3.5 s, on the page too, which may be behind
    assert page.comes_true(f"{SHOWN}[0] > {enough}")
    page.run("document.getElementById('pause').click()")
    assert page.comes_true("document.getElementById('when').textContent !== 'now'")
    still = page.run(f"new Promise((done) => setTimeout(() => done({SHOWN}), 150))")
    later = ear.newest("pose").seq + 50
    assert ear.hears("pose", lambda pose: pose.seq > later, 30.0)
    assert page.run(SHOWN) == still
    page.run("""(() => {
      const scrub = document.getElementById('scrub');
      scrub.value = Number(scrub.value) - 2;
      scrub.dispatchEvent(new Event('input'));
    })()""")
    assert page.comes_true(f"{SHOWN}[0] < {still[0]}")
    seq, x, *_ = page.run(SHOWN)
    all_poses = ear.all("pose")
    ear.close()
    assert seq in all_poses
    assert number(x) == pytest.approx(all_poses[seq].x, abs=0.51e-4)
    back = (all_poses[still[0]].stamp - all_poses[seq].stamp) * 1e-9
    assert back == pytest.approx(2.0, abs=0.6)
    page.run("document.getElementById('pause').click()")
    assert page.comes_true(f"{SHOWN}[0] > {still[0]}")
    assert page.run("document.getElementById('when').textContent") == "now"


def test_arrow_keys_drive_and_letting_go_stops(page: Chromium, up: Up) -> None:
    ear = Ear(up, "truth")
    page.run("document.getElementById('map').focus()")
    page.key("ArrowUp", down=True)
    assert ear.hears("truth", lambda truth: truth.v > 0.17)
    page.key("ArrowUp", down=False)
    assert ear.hears("truth", lambda truth: abs(truth.v) < 0.01)
    page.key("ArrowLeft", down=True)
    assert ear.hears("truth", lambda truth: truth.w > 1.2)
    assert abs(ear.newest("truth").v) < 0.02
    page.run("window.dispatchEvent(new Event('blur'))")
    assert ear.hears("truth", lambda truth: abs(truth.w) < 0.05)
    page.key("ArrowLeft", down=False)
    page.run("document.getElementById('drive-toggle').click()")
    assert ear.hears("truth", lambda truth: truth.v > 0.08, 20.0), "back on its course"
    ear.close()


LETTING_GO = {
    "with control held": "",
    "when a tab has the focus": "document.querySelector('[role=tab]').focus()",
    "when a node was opened": "document.querySelector('.node').dispatchEvent(new Event('click'))",
}


@pytest.mark.parametrize("how", LETTING_GO)
def test_a_key_that_is_let_go_stops_the_robot_whatever_came_between(
    how: str, page: Chromium, up: Up
) -> None:
    assert page.comes_true("document.querySelector('.node') !== null")
    ear = Ear(up, "truth")
    page.run("document.getElementById('map').focus()")
    page.key("ArrowUp", down=True)
    assert ear.hears("truth", lambda truth: truth.v > 0.17)
    if LETTING_GO[how]:
        page.run(LETTING_GO[how])
    else:
        page.key("Control", down=True, control=True)
    page.key("ArrowUp", down=False, control=not LETTING_GO[how])
    assert ear.hears("truth", lambda truth: abs(truth.v) < 0.01)
    page.key("Control", down=False)
    page.run("document.getElementById('detail').close()")
    page.key("Escape", down=True)
    page.key("Escape", down=False)
    assert page.run("document.getElementById('drive-toggle').ariaPressed") == "false"
    assert ear.hears("truth", lambda truth: truth.v > 0.08, 20.0), "back on its course"
    ear.close()


def test_an_arrow_key_that_scrolls_does_not_drive(page: Chromium) -> None:
    for place in ("document.body", "document.getElementById('log')"):
        page.run(f"{place}.focus()")
        page.key("ArrowUp", down=True)
        page.key("ArrowUp", down=False)
        assert page.run("document.getElementById('drive-toggle').ariaPressed") == "false"


def test_a_page_without_the_token_shows_no_wheel_and_no_restart(
    chromium: Chromium, dash: Dash
) -> None:
    chromium.open("about:blank")
    chromium.open(dash.url)
    chromium.run("sessionStorage.clear()")
    chromium.open(dash.url.partition("#")[0])
    assert chromium.comes_true(LIVE)
    assert chromium.run("document.getElementById('access').textContent") == "read-only"
    assert chromium.run("document.getElementById('drive').hidden")
    assert chromium.comes_true("document.querySelector('.node') !== null")
    chromium.run("document.querySelector('.node').dispatchEvent(new Event('click'))")
    assert chromium.run("document.getElementById('detail').open")
    assert chromium.run("document.getElementById('restart').hidden")
    assert chromium.troubles == []


def test_the_token_leaves_the_address_and_survives_a_reload(page: Chromium, dash: Dash) -> None:
    assert page.run("location.href") == f"http://127.0.0.1:{dash.port}/"
    page.call("Page.reload")
    assert page.comes_true(f"{LIVE} && !document.getElementById('drive').hidden")


def test_a_node_opens_by_keyboard_and_tells_what_it_is(page: Chromium, up: Up) -> None:
    pid = up.ps()["ekf"]["pid"]
    assert page.comes_true("document.querySelector('#graph [data-node=ekf]') !== null")
    page.run("document.querySelector('#graph [data-node=ekf]').focus()")
    page.call("Input.dispatchKeyEvent", type="keyDown", key="Enter", code="Enter", text="\r")
    page.call("Input.dispatchKeyEvent", type="keyUp", key="Enter", code="Enter")
    body = "document.getElementById('detail-body').textContent"
    assert page.comes_true(f"{body}.includes('pid {pid}')")
    assert page.comes_true(f"/odom.*ms.*magnets.*ms/s.test({body})")
    assert not page.run("document.getElementById('restart').hidden")
    page.run("document.getElementById('restart').click()")
    assert page.run("document.getElementById('restart').textContent") == "Really restart ekf?"


def test_a_node_shows_what_it_said_itself(page: Chromium, up: Up) -> None:
    client = Client(up.folder)
    told = client.publisher("rover/@log/robot", "application/json")
    line = {"n": 1 << 40, "time": time.time(), "name": "ekf", "text": "a word of its own"}
    assert page.comes_true("document.querySelector('#graph [data-node=ekf]') !== null")
    page.run("document.querySelector('#graph [data-node=ekf]').dispatchEvent(new Event('click'))")
    told.put(json.dumps([line]).encode())
    body = "document.getElementById('detail-body').textContent"
    assert page.comes_true(f"{body}.includes('a word of its own')")
    page.run("document.getElementById('detail').close()")
    client.close()


def test_a_calibration_shows_its_ring_then_the_circle_before_and_after(
    page: Chromium, up: Up
) -> None:
    """What `lodeline calibrate mag` tells the page, as its own test hears it."""
    client = Client(up.folder)
    told = client.publisher("rover/@calibrating", "application/json")
    running: dict[str, object] = {
        "kind": "mag",
        "todo": "turn",
        "state": "running",
        "text": "0.5 of 2 turns",
    }
    running |= {"parts": [0.5] * 12 + [0.0] * 12, "names": [], "hint": ""}
    shown = "document.getElementById('calibrate')"

    def says() -> bool:
        told.put(json.dumps(running).encode())
        return bool(page.run(f"!{shown}.hidden && {shown}.textContent.includes('0.5 of 2 turns')"))

    assert eventually(says, 20.0, 0.1)
    ink = """(() => {
      const canvas = document.getElementById('calibrate-ring');
      const {data} = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height);
      return data.filter((value, i) => i % 4 === 3 && value > 0).length;
    })()"""
    assert page.comes_true(f"{ink} > 300")
    circle = [(20e-6 * math.cos(0.1 * i), 20e-6 * math.sin(0.1 * i)) for i in range(63)]
    picture = {"before": circle, "after": circle, "radius": 20e-6}
    end = running | {"state": "written", "text": "good", "words": "wrong by 9 deg before"}
    told.put(json.dumps(end | {"circles": picture}).encode())
    assert page.comes_true(f"{shown}.textContent.includes('wrong by 9 deg before')")
    assert page.comes_true(f"{ink} > 300")
    refused = {"kind": "gyro", "todo": "wait", "state": "refused", "text": "it moved"}
    told.put(json.dumps(refused).encode())
    assert page.comes_true(f"{shown}.dataset.state === 'refused'")
    assert page.run(f"{shown}.textContent.includes('it moved')")
    page.run("document.getElementById('calibrate-close').click()")
    assert page.run(f"{shown}.hidden")
    client.close()


def test_the_log_shows_what_the_supervisor_said(page: Chromium) -> None:
    assert page.comes_true("document.getElementById('log').textContent.includes('9 nodes in 9')")


@pytest.mark.parametrize("size", [(1280, 720), (1920, 1080), (800, 1000), (390, 844)])
def test_nothing_scrolls_sideways(chromium: Chromium, dash: Dash, size: tuple[int, int]) -> None:
    chromium.open(dash.url, *size)
    assert chromium.comes_true(LIVE)
    root = "document.documentElement"
    assert chromium.run(f"{root}.scrollWidth <= innerWidth")
    if size[0] >= 1100:
        assert chromium.run(f"{root}.scrollHeight <= innerHeight")
    assert chromium.troubles == []


def test_every_control_has_a_name(page: Chromium) -> None:
    nodes = page.call("Accessibility.getFullAXTree")["nodes"]
    controls = [
        node
        for node in nodes
        if node.get("role", {}).get("value") in ("button", "slider", "tab", "image", "application")
        and not node["ignored"]
    ]
    assert len(controls) > 15
    for node in controls:
        assert node["name"]["value"], node


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_text_has_contrast_in_both_schemes(chromium: Chromium, dash: Dash, scheme: str) -> None:
    chromium.open(dash.url, scheme=scheme)
    assert chromium.comes_true(LIVE)
    assert chromium.run("document.documentElement.dataset.theme") == scheme
    names = ["ink", "ink-2", "ink-3", "ekf", "odom", "truth", "hit", "good", "warn", "bad"]
    read = "getComputedStyle(document.documentElement).getPropertyValue('--{}').trim()"
    panel = luminance(chromium.run(read.format("panel")))
    for name in names:
        own = luminance(chromium.run(read.format(name)))
        ratio = (max(own, panel) + 0.05) / (min(own, panel) + 0.05)
        assert ratio >= 4.5, (name, ratio)


def luminance(colour: str) -> float:
    """Relative luminance of #rrggbb, as WCAG 2 defines it."""
    parts = [int(colour[i : i + 2], 16) / 255 for i in (1, 3, 5)]
    linear = [p / 12.92 if p <= 0.04045 else ((p + 0.055) / 1.055) ** 2.4 for p in parts]
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]


def test_tilt_on_the_page_is_that_of_the_library(page: Chromium) -> None:
    picks = random.Random(4)
    angles = [
        (picks.uniform(-3, 3), picks.uniform(-1.5, 1.5), picks.uniform(-3, 3)) for _ in range(50)
    ]
    quaternions = [from_euler(*each) for each in angles]
    shown = page.run(
        f"import('/store.js').then((m) => {json.dumps(quaternions)}.map((q) => m.euler(q)))"
    )
    for (roll, pitch, yaw), made in zip(angles, shown, strict=True):
        assert made["roll"] == pytest.approx(roll, abs=1e-9)
        assert made["pitch"] == pytest.approx(pitch, abs=1e-9)
        assert made["yaw"] == pytest.approx(yaw, abs=1e-9)


def test_a_graph_with_a_cycle_and_lonely_nodes_is_laid_out_once_each(page: Chromium) -> None:
    edges = [("a", "b"), ("b", "c"), ("c", "b"), ("a", "c")]
    script = json.dumps([{"from": tail, "to": head} for tail, head in edges])
    layers = page.run(
        f"import('/graph.js').then((m) => m.layered(['a', 'b', 'c', 'lonely'], {script}))"
    )
    places = [(item["name"], depth) for depth, layer in enumerate(layers) for item in layer]
    assert sorted(name for name, _ in places) == ["a", "b", "c", "lonely"]
    assert all(len({item["row"] for item in layer}) == len(layer) for layer in layers)


def test_a_breach_of_the_policy_would_be_noticed(chromium: Chromium, dash: Dash) -> None:
    chromium.open(dash.url)
    assert chromium.comes_true(LIVE)
    assert chromium.troubles == []
    chromium.run("{ document.body.append(Object.assign(new Image(), {src: '//evil.example/x'})) }")
    assert chromium.comes_true("1") and eventually(
        lambda: chromium.run("1") == 1 and bool(chromium.troubles), 5.0
    )
    assert "Content Security Policy" in chromium.troubles[0]
    blocked = "(() => { try { document.body.innerHTML = 'x'; } catch { return true; } })()"
    assert chromium.run(blocked) is True


def test_a_gateway_that_dies_shows_and_its_successor_is_found(chromium: Chromium, up: Up) -> None:
    first = Dash(up)
    chromium.open(first.url)
    assert chromium.comes_true(LIVE)
    first.kill()
    assert chromium.comes_true(f"{STATE} === 'disconnected'", 15.0)
    assert "DISCONNECTED" in chromium.run("document.getElementById('alarm').textContent")
    assert chromium.run("document.getElementById('drive').hidden")
    second = Dash(up, "--port", str(first.port))
    assert chromium.comes_true(LIVE, 15.0)
    assert chromium.run("document.getElementById('alarm').hidden")
    assert chromium.run("document.getElementById('access').textContent") == "read-only"
    chromium.open("about:blank")
    second.stop()


WATCHED = """
window.begun = performance.now();
window.states = [];
new MutationObserver(() => window.states.push(document.documentElement.dataset.state))
  .observe(document.documentElement, {attributeFilter: ["data-state"]});
0
"""


def test_a_pipeline_that_stops_shows_and_its_next_run_is_found(chromium: Chromium) -> None:
    with Up(ROOT / "pipeline.yaml") as first:
        dash = Dash(first)
        chromium.open(dash.url)
        assert chromium.comes_true(LIVE)
        first.stop()
        assert chromium.comes_true(f"{STATE} === 'gone'", 15.0)
        alarm = chromium.run("document.getElementById('alarm').textContent")
        assert "DISCONNECTED" in alarm
        assert "lodeline up" in alarm
        # The line to the gateway is whole: that nothing comes over it is no reason to open another.
        chromium.run(WATCHED)
        assert chromium.comes_true("performance.now() > window.begun + 6000", 15.0)
        assert chromium.run("window.states") == []
        with Up(ROOT / "pipeline.yaml", base=first.run):
            assert chromium.comes_true(LIVE, 15.0)
            assert chromium.comes_true("!document.getElementById('drive').hidden")
            shown = chromium.run(SHOWN)
            assert chromium.comes_true(f"{SHOWN}[0] !== {shown[0]}")
        assert chromium.troubles == []
        chromium.open("about:blank")
        dash.stop()


def test_what_is_paused_stays_for_longer_than_the_minute(page: Chromium) -> None:
    kept = page.run("""import('/store.js').then(({Store}) => {
      const store = new Store();
      store.begin({keys: {}});
      const feed = (from, to) => {
        for (let n = from; n < to; n += 1) store.addFrame({n, at: n / 20, keys: {}, hits: []});
      };
      feed(0, 2000);
      store.hold(10);
      const held = store.shown.n;
      feed(2000, 6000);
      const still = store.shown.n;
      store.hold(0);
      return [held, still, store.frames[0].n, store.shown.n, store.frames.length];
    })""")
    assert kept == [1799, 1799, 4799, 5999, 1201]


def test_a_clock_that_is_set_back_leaves_no_frames_that_never_get_old(page: Chromium) -> None:
    kept = page.run("""import('/store.js').then(({Store}) => {
      const store = new Store();
      store.begin({keys: {}});
      for (let n = 0; n < 100; n += 1) {
        const at = n < 50 ? 3600 + n / 20 : n / 20;
        store.addFrame({n, at, keys: {}, hits: []});
        store.addStatus({at, nodes: {}});
      }
      return [store.frames[0].n, store.frames.length, store.statuses.length];
    })""")
    assert kept == [50, 50, 50]


def test_hours_of_pause_keep_a_minute_before_it_and_the_last_one(page: Chromium) -> None:
    kept = page.run("""import('/store.js').then(({Store}) => {
      const store = new Store();
      store.begin({keys: {}});
      for (let at = 0; at < 8 * 3600; at += 1) {
        if (at === 100) store.hold(0.001);
        store.addFrame({n: at, at, keys: {}, hits: []});
        store.addStatus({at, nodes: {}});
      }
      return [store.statuses.length, store.shownStatus.at, store.waiting.length];
    })""")
    assert kept[0] < 150 and kept[1] == 98 and kept[2] <= 61


def test_who_paused_keeps_the_moment_over_a_line_that_was_lost(page: Chromium) -> None:
    """Also where the gateway was started again, and numbers its frames anew."""
    shown = page.run("""import('/store.js').then(({Store}) => {
      const store = new Store();
      const scene = {keys: {}, started: 1, digest: 'a'};
      store.begin(scene);
      for (let n = 0; n < 200; n += 1) store.addFrame({n, at: n / 20, keys: {}, hits: []});
      store.hold(2);
      const before = store.shown.at;
      store.resume(scene);
      for (let n = 0; n < 300; n += 1) store.addFrame({n, at: 5 + n / 20, keys: {}, hits: []});
      const during = store.shown.at;
      store.hold(0);
      const times = store.frames.map(({at}) => at);
      return [before, during, times.at(-1), times.every((at, i) => !i || at > times[i - 1])];
    })""")
    assert shown[0] == shown[1]
    assert shown[2] == pytest.approx(5 + 299 / 20) and shown[3] is True


BARE = f"""
name: bare
nodes:
  simulator: {{run: {ROOT}/nodes/simulator.py, outputs: {{truth: truth}}}}
"""


def test_each_of_two_robots_has_a_page_of_its_own_and_a_bare_one_says_what_it_lacks(
    chromium: Chromium, up: Up, tmp_path: Path
) -> None:
    file = tmp_path / "bare.yaml"
    file.write_text(BARE)
    with Up(file, base=up.run):
        which = up.call("dash", "--seconds", "0")
        assert which.returncode == 4
        assert which.stderr == "several pipelines run: choose by --name (bare, rover)\n"
        for name in ("bare", "rover"):
            dash = Dash(up, "--name", name)
            chromium.open(dash.url)
            assert chromium.comes_true(f"{STATE} === 'live'")
            assert chromium.run("document.getElementById('name').textContent") == name
            told = chromium.run("!document.getElementById('bound-row').hidden")
            assert told is (name == "rover")
            assert chromium.run("document.getElementById('horizon-box').hidden") is not told
            assert chromium.troubles == []
            chromium.open("about:blank")
            dash.stop()
