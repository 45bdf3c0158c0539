#!/usr/bin/python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""web-events as its viewers see it, in headless Chromium."""
import contextlib
import http.client
import os
import re
import subprocess
import tempfile
import time
from urllib.parse import urlsplit

from browser import Browser
from servers import SECONDS, ServerProcess

PROGRAM = os.path.join(os.environ["SOURCE"], "pipelines", "web_events.py")

# The number of pixels in the colours of ON, OFF and no event, and the picture itself.
PICTURE = """(() => {
  const video = document.querySelector("video");
  if (!video?.videoWidth) return null;
  const canvas = document.createElement("canvas");
  canvas.width = video.videoWidth;
  canvas.height = video.videoHeight;
  const context = canvas.getContext("2d");
  context.drawImage(video, 0, 0);
  const pixels = context.getImageData(0, 0, canvas.width, canvas.height).data;
  const picture = { size: canvas.width * canvas.height, on: 0, off: 0, none: 0, sum: 0 };
  for (let i = 0; i < pixels.length; i += 4) {
    const [red, , blue] = pixels.subarray(i, i + 3);
    if (red > 180) picture.on++;
    else if (blue - red > 90) picture.off++;
    else if (red < 60) picture.none++;
    picture.sum = (picture.sum * 31 + red + blue) % 1000003;
  }
  return picture;
})()"""


def wait_for(what, condition):
    deadline = time.monotonic() + SECONDS
    while not (value := condition()):
        assert time.monotonic() < deadline, f"not within {SECONDS} s: {what}; {server.descriptors()} descriptors"
        time.sleep(0.2)
    return value


def refused(words, *arguments):
    result = subprocess.run([PROGRAM, *arguments], capture_output=True, text=True, timeout=SECONDS, check=False)
    assert result.returncode in (1, 2), f"{arguments}: exit status {result.returncode}"
    assert words in result.stderr and "Traceback" not in result.stderr, result.stderr


def see_events(page):
    """Waits for three different pictures that show events of both polarities."""
    sums = set()

    def three():
        picture = page.evaluate(PICTURE)
        if picture and picture["on"] > 50 and picture["off"] > 50 and picture["none"] > picture["size"] / 2:
            sums.add(picture["sum"])
        return len(sums) >= 3

    wait_for("three pictures of events", three)


def see_rate(page):
    wait_for("an event rate", lambda: re.fullmatch(
        r"[1-9][\d.]*[KM]? events/s", page.evaluate("document.querySelector('output').textContent")))


def closing_code(page, url, message):
    """With what code the server closes a WebSocket that sends it `message`."""
    return page.evaluate(f"""new Promise(resolve => {{
      const socket = new WebSocket({url.replace('http', 'ws') + 'viewer'!r});
      socket.onopen = () => socket.send({message!r});
      socket.onclose = ({{ code }}) => resolve(code);
      setTimeout(() => resolve("nothing"), {SECONDS * 1000});
    }})""")


def status_of(url, path, **headers):
    """The HTTP status that a request is answered with."""
    connection = http.client.HTTPConnection(urlsplit(url).netloc, timeout=SECONDS)
    connection.request("GET", path, headers=headers)
    status = connection.getresponse().status
    connection.close()
    return status


def handshake(url, **headers):
    """The HTTP status that a WebSocket is answered with."""
    return status_of(url, "/viewer", **headers, **{
        "Connection": "Upgrade", "Upgrade": "websocket",
        "Sec-WebSocket-Version": "13", "Sec-WebSocket-Key": "dGhlIHNhbXBsZSBub25jZQ=="})


def send_body(url, method, **headers):
    """The HTTP status that a request with a body of 100 MB is answered with, and how much of it was sent."""
    connection = http.client.HTTPConnection(urlsplit(url).netloc, timeout=SECONDS)
    connection.putrequest(method, "/", skip_host="Host" in headers)
    for name, value in headers.items():
        connection.putheader(name, value)
    connection.putheader("Content-Length", str(100 << 20))
    connection.endheaders()
    sent = 0
    with contextlib.suppress(OSError):  # of the closed connection
        while sent < 100:
            connection.send(bytes(1 << 20))
            sent += 1
    status = connection.getresponse().status
    connection.close()
    return status, sent


def stay_connected(url, count):
    """Loads the page with clients that would keep their connection, and then close it."""
    clients = [http.client.HTTPConnection(urlsplit(url).netloc, timeout=SECONDS) for _ in range(count)]
    for client in clients:
        client.request("GET", "/")
        assert client.getresponse().read()
    for client in clients:
        client.close()


with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as profile, contextlib.ExitStack() as at_end:
    server = ServerProcess(PROGRAM, "--port", "0", "--host", "MyServer.example")
    at_end.callback(server.process.kill)
    url = re.search(r"http://\S+/", server.address)[0]
    browser = Browser(profile)
    at_end.callback(browser.close)

    first = browser.open(url)
    see_events(first)
    see_rate(first)
    wait_for("the state", lambda: first.evaluate("state.textContent") == "live")
    assert first.evaluate("document.title") == "test scene, eventsim-dvs", first.evaluate("document.title")
    wait_for("a curve of rates", lambda: len((first.evaluate("curve.getAttribute('points')") or "").split()) > 3)
    print("one viewer sees events, their rate and its curve, what is shown and the state")

    first.resize(390, 844)
    video, rate = (first.evaluate(f"document.querySelector('{name}').getBoundingClientRect().toJSON()")
                   for name in ("video", "output"))
    assert video["width"] == 390 and rate["top"] >= video["bottom"], f"on a phone: {video}, {rate}"
    assert first.evaluate("document.documentElement.scrollWidth") == 390, "the page is wider than a phone"
    first.resize(1280, 720)
    print("on a phone the picture is as wide as the page, and the rate is below it")

    other = browser.open(url)
    first.evaluate("mode.value = 'decay', mode.onchange()")
    for page in (first, other):
        wait_for("the mode of all viewers", lambda page=page: page.evaluate("mode.value") == "decay")
    wait_for("pictures of events that fade", lambda: (picture := first.evaluate(PICTURE)) and
             picture["size"] - picture["none"] - picture["on"] - picture["off"] > 300)
    other.evaluate("mode.value = 'accumulate', mode.onchange()")
    other.close()
    print("a viewer chooses how all see the events")

    alone = server.descriptors() + 3  # browsers keep connections for later; a viewer needs about 20
    for name in ("second", "third"):
        other = browser.open(url)
        see_events(other)
        see_rate(other)
        see_events(first)
        other.close()
        wait_for(f"all that the {name} viewer needed is closed", lambda: server.descriptors() <= alone)
        see_events(first)
    for _ in range(9):  # left before anything is negotiated
        assert handshake(url, Origin=url[:-1]) == 101
    browser.open(url).close()
    wait_for("all that a hasty viewer needed is closed", lambda: server.descriptors() <= alone)
    stay_connected(url, 100)
    wait_for("connections that clients closed are closed", lambda: server.descriptors() <= alone)
    see_events(first)
    print("viewers come and leave, and the first sees events still")

    for message in ("[]", '{"answer": "nonsense"}', '{"mode": "nonsense"}', '{"candidate": null}', "[" * 100_000,
                    '{"candidate": {"sdpMLineIndex": -1, "candidate": ""}}'):
        code = closing_code(first, url, message)
        assert code == 1007, f"{message}: it was answered with {code}"
    for origin, status in (("http://elsewhere", 403), ("null", 403), ("http://[bad", 400), (url[:-1], 101)):
        answer = handshake(url, Origin=origin)
        assert answer == status, f"a page of {origin} is answered with {answer}"
    for host, status in (("elsewhere.example", 403), ("[bad", 400), ("myserver.example", 200)):
        answer = status_of(url, "/", Host=host)
        assert answer == status, f"a request to {host} is answered with {answer}"
    assert handshake(url, Host="elsewhere.example", Origin="http://elsewhere.example") == 403
    memory = server.memory()
    for method, headers, status in (("POST", {}, 405), ("PUT", {"Origin": "http://elsewhere"}, 403), ("GET", {}, 413)):
        answer, sent = send_body(url, method, **headers)
        assert answer == status and sent < 50, f"{method} {headers} is answered with {answer} after {sent} MB"
    assert server.memory() < memory + 50, f"bodies are kept: {memory} MB, then {server.memory()}"
    for path, status in (("/%ff", 400), ("/viewer/%ff", 400), ("/nowhere", 404)):
        answer = status_of(url, path)
        assert answer == status, f"{path} is answered with {answer}"
    see_events(first)
    print("strange messages, bodies and other sites' pages are refused")

    port = re.search(r":(\d+)/", url)[1]
    refused("Address already in use; choose another with --port", "--port", port)
    refused("nowhere is no file", "--source", "nowhere", "--port", "0")
    refused("eventsim-nothing", "--simulator", "eventsim-nothing", "--port", "0")
    print("errors are told")

    server.interrupt()
    wait_for("the viewer learns that the server has ended", lambda: "reconnecting" in first.evaluate(
        "state.textContent"))
    assert first.evaluate("!last.hidden && last.width > 0"), "the last picture is gone"
    print("Ctrl-C ends it, and the last picture stays")

    server = ServerProcess(PROGRAM, "--port", port)
    at_end.callback(server.process.kill)
    wait_for("the viewer reconnects", lambda: first.evaluate("last.hidden"))
    see_events(first)
    see_rate(first)
    assert first.evaluate("state.textContent") == "live", first.evaluate("state.textContent")
    server.interrupt()
    print("viewers reconnect when the server is back")

    recording = os.path.join(profile, "ball.raw")
    subprocess.run([os.environ["GST_LAUNCH"], "-q", "videotestsrc", "pattern=ball", "num-buffers=60", "!", "eventsim-diff",
                    "!", "evtenc", "!", "filesink", f"location={recording}"], check=True)
    for source, name in ((recording, "ball.raw"), ("videotestsrc is-live=true pattern=ball ! eventsim-diff", "pipeline")):
        server = ServerProcess(PROGRAM, "--port", port, "--source", source)
        at_end.callback(server.process.kill)
        wait_for(f"the name {name}", lambda name=name: first.evaluate("document.title") == name)
        time.sleep(3)  # the recording has 2 s
        see_events(first)
        server.interrupt()
    print("a recording, which is repeated, and a pipeline are sources")
