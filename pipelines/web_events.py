#!/usr/bin/python3 -B
# SPDX-License-Identifier: LGPL-2.1-or-later
"""Serves a page that shows the events of a camera live, with their rate of the last ten seconds; any number
of browsers can watch, and each can change how all see them drawn. Ctrl-C ends it.

    web-events --device /dev/video0

Without --device or --source it shows a test scene. By default only browsers on this machine can connect; with
--address 0.0.0.0, anyone who can reach this machine can, without a password."""
import ipaddress
import json
import os
import socket
import sys
from urllib.parse import unquote_to_bytes, urlsplit

try:
    import gi

    gi.require_version("Gst", "1.0")
    gi.require_version("GstSdp", "1.0")
    gi.require_version("GstVideo", "1.0")
    gi.require_version("GstWebRTC", "1.0")
    gi.require_version("Soup", "3.0")
    from gi.repository import Gio, GLib, Gst, GstSdp, GstVideo, GstWebRTC, Soup
except (ImportError, ValueError) as missing:
    sys.exit(f"error: {missing}\nOn Debian, install: python3-gi gir1.2-gst-plugins-base-1.0"
             " gir1.2-gst-plugins-bad-1.0 gir1.2-soup-3.0")

from capture import Capture, Source, host_of, server_options  # noqa: E402
from program import find_elements, find_plugins, run  # noqa: E402

PAGE = os.path.join(os.path.dirname(os.path.realpath(__file__)), "web_events.html")
ELEMENTS = ["vp8enc", "rtpvp8pay", "webrtcbin", "nicesink", "dtlssrtpenc"]

DRAW_AND_ENCODE = (
    "{simulator} ! application/x-event-camera ! eventstats interval=500000000 ! eventrender name=renderer"
    " ! video/x-raw,framerate=30/1 ! videoconvert ! queue leaky=downstream max-size-buffers=2"
    " ! vp8enc name=encoder deadline=1 cpu-used=8 threads=2 target-bitrate=4000000"
    " keyframe-max-dist=3600")
# If a browser is too slow, frames are dropped, and the browser requests a key frame.
SEND = ("appsrc name=encoded is-live=true format=time leaky-type=downstream"
        " max-buffers=8 max-bytes=0 max-time=0 ! rtpvp8pay picture-id-mode=15-bit ! webrtcbin"
        " name=webrtc bundle-policy=max-bundle")
RTP = "application/x-rtp,media=video,encoding-name=VP8,clock-rate=90000,payload=96"


def forward(_, info, need_key_frame):
    """Forwards a browser's request for a key frame."""
    if info.get_event().has_name("GstForceKeyUnit"):
        need_key_frame()
    return Gst.PadProbeReturn.OK


def is_address(host):
    try:
        ipaddress.ip_address(host)
    except ValueError:
        return False
    return True


def refuse(message, status):
    """Answers a request at its headers and closes the connection: libsoup would read, and keep, its body first."""
    connection = message.steal_connection()
    reason = Soup.Status.get_phrase(status)
    connection.get_output_stream().write_all(
        f"HTTP/1.1 {int(status)} {reason}\r\nConnection: close\r\nContent-Length: 0\r\n\r\n".encode())
    connection.close()


class Viewer:
    """A browser: its WebSocket, and the WebRTC connection negotiated through it. Calls `need_key_frame`,
    from any thread, when the browser needs one to decode, `set_mode` when its user chooses a mode of drawing, which
    raises ValueError if there is none such, and `end` when it has disconnected."""

    def __init__(self, websocket, capture, need_key_frame, set_mode, end):
        self._websocket = websocket
        self._capture = capture
        self._need_key_frame = need_key_frame
        self._set_mode = set_mode
        self._end = end
        self._has_offered = False
        self._has_left = False
        self._pipeline = Gst.parse_launch(SEND)
        self._webrtc = self._pipeline.get_by_name("webrtc")
        self._encoded = self._pipeline.get_by_name("encoded")
        transceiver = self._webrtc.emit("get-transceiver", 0)
        transceiver.set_property("direction", GstWebRTC.WebRTCRTPTransceiverDirection.SENDONLY)
        transceiver.set_property("do-nack", True)
        transceiver.set_property("codec-preferences", Gst.Caps.from_string(RTP))
        self._encoded.get_static_pad("src").add_probe(Gst.PadProbeType.EVENT_UPSTREAM, forward, need_key_frame)
        self._bus = self._pipeline.get_bus()
        self._bus.add_signal_watch()
        capture.attach(self._encoded, self._pipeline)
        self._handlers = [(instance, instance.connect(name, handle)) for instance, name, handle in (
            (self._webrtc, "on-negotiation-needed", self._create_offer),
            (self._webrtc, "on-ice-candidate", self._send_candidate),
            (self._webrtc, "notify::connection-state", self._connection_changed),
            (self._bus, "message::error", self._fail),
            (websocket, "message", self._receive),
            (websocket, "closed", self._closed))]
        self._pipeline.set_state(Gst.State.PLAYING)

    # from any thread

    def send(self, **message):
        GLib.idle_add(self._send, json.dumps(message))

    # from streaming threads

    def _create_offer(self, webrtc):
        def created(promise):
            reply = promise.get_reply()  # owns the offer
            if reply and reply.has_field("offer"):
                # By default libnice asks the router to forward ports.
                webrtc.iterate_all_by_element_factory_name("nicesink").foreach(
                    lambda sink: sink.get_property("agent").set_property("upnp", False))
                offer = reply.get_value("offer")
                webrtc.emit("set-local-description", offer, Gst.Promise.new_with_change_func(offered))
                self.send(offer=offer.sdp.as_text())
            else:
                GLib.idle_add(self._offered)

        def offered(_):
            GLib.idle_add(self._offered)

        webrtc.emit("create-offer", None, Gst.Promise.new_with_change_func(created))

    def _send_candidate(self, _, line, candidate):
        self.send(candidate={"sdpMLineIndex": line, "candidate": candidate})

    def _connection_changed(self, webrtc, _):
        state = webrtc.get_property("connection-state")
        if state == GstWebRTC.WebRTCPeerConnectionState.CONNECTED:
            self._need_key_frame()
        elif state == GstWebRTC.WebRTCPeerConnectionState.FAILED:
            GLib.idle_add(self.close)

    # from the main thread

    def stop(self):
        for instance, handler in self._handlers:
            instance.disconnect(handler)
        self._bus.remove_signal_watch()
        self._capture.detach(self._encoded)
        self._pipeline.set_state(Gst.State.NULL)

    def close(self):
        if self._websocket.get_state() == Soup.WebsocketState.OPEN:
            self._websocket.close(Soup.WebsocketCloseCode.GOING_AWAY, None)

    def _send(self, text):
        if self._websocket.get_state() == Soup.WebsocketState.OPEN:
            self._websocket.send_text(text)

    def _receive(self, _, __, data):
        try:
            for name, value in json.loads(data.get_data()).items():
                if name == "answer":
                    self._set_answer(value)
                elif name == "mode":
                    self._set_mode(value)
                elif name == "candidate":
                    self._webrtc.emit("add-ice-candidate", value["sdpMLineIndex"], value["candidate"])
        except (ValueError, TypeError, KeyError, AttributeError, OverflowError, RecursionError) as cause:
            self._refuse(f"unexpected message: {cause}")

    def _set_answer(self, text):
        def done(promise):
            reply = promise.get_reply()
            if reply and reply.has_field("error"):
                GLib.idle_add(self._refuse, "unsuitable answer")

        if not text:
            raise ValueError("empty answer")
        _, sdp = GstSdp.SDPMessage.new_from_text(text)
        answer = GstWebRTC.WebRTCSessionDescription.new(GstWebRTC.WebRTCSDPType.ANSWER, sdp)
        self._webrtc.emit("set-remote-description", answer, Gst.Promise.new_with_change_func(done))

    def _refuse(self, reason):
        if self._websocket.get_state() == Soup.WebsocketState.OPEN:
            self._websocket.close(Soup.WebsocketCloseCode.BAD_DATA, reason[:100])

    def _fail(self, _, message):
        print(f"Disconnected a viewer: {message.parse_error()[0].message}", file=sys.stderr)
        self._offered()
        self.close()

    def _offered(self):
        if self._has_left and not self._has_offered:
            self._leave()
        self._has_offered = True

    def _closed(self, _):
        self._has_left = True
        # webrtcbin 1.22 leaks its sockets if it is stopped while it sets its offer.
        if self._has_offered:
            self._leave()

    def _leave(self):
        self.stop()
        self._end(self)


class Server:
    """Serves the page, and streams to its viewers."""

    def __init__(self, device, source, simulator, hosts):
        source = Source(device, source)
        self._name = source.name if source.has_events else f"{source.name}, {simulator.split()[0]}"
        drawn = DRAW_AND_ENCODE.format(simulator="identity" if source.has_events else simulator)
        self._capture = Capture(device, source, drawn, self._send_rate)
        self._renderer = self._capture.pipeline.get_by_name("renderer")
        self._encoder = self._capture.pipeline.get_by_name("encoder").get_static_pad("src")
        self._viewers = []
        self._hosts = {name.lower() for name in ("localhost", socket.gethostname(), *hosts)}
        self._http = Soup.Server()
        self._http.connect("request-started", lambda _, message: message.connect("got-headers", self._check))
        self._http.add_handler("/", self._serve_page)
        self._http.add_websocket_handler("/viewer", None, None, self._add_viewer)

    def run(self, address, port):
        try:
            self._http.listen(Gio.InetSocketAddress.new_from_string(str(address), port), 0)
        except GLib.Error as cause:
            raise RuntimeError(f"cannot listen on {address}, port {port}: {cause.message}; "
                               "choose another with --port") from cause
        self._capture.start()
        port = self._http.get_uris()[0].get_port()
        print(f"Events are shown at http://{host_of(address)}:{port}/ until Ctrl-C", flush=True)
        try:
            self._capture.run()
        finally:
            for viewer in self._viewers:
                viewer.stop()
            self._http.disconnect()

    def _check(self, message):
        """Rejects malformed and cross-origin requests. Against DNS rebinding, the host must be an IP address or a
        known name: an attacker's name may resolve to this machine."""
        headers = message.get_request_headers()
        host = headers.get_one("Host")
        message.get_response_headers().replace("Connection", "close")  # libsoup keeps closed ones otherwise
        try:
            unquote_to_bytes(message.get_uri().to_string()).decode()
            name = urlsplit(f"//{host}").hostname
            if host is None or name is None:
                raise ValueError("no Host")
            origin = headers.get_one("Origin")
            is_cross_origin = origin is not None and urlsplit(origin).netloc != host
        except ValueError as cause:
            print(f"Refused a malformed request: {cause}", file=sys.stderr)
            refuse(message, Soup.Status.BAD_REQUEST)
            return
        if is_cross_origin or not (name in self._hosts or is_address(name)):
            refuse(message, Soup.Status.FORBIDDEN)
        elif message.get_method() not in ("GET", "HEAD"):
            refuse(message, Soup.Status.METHOD_NOT_ALLOWED)
        elif headers.get_one("Content-Length") or headers.get_one("Transfer-Encoding"):
            refuse(message, Soup.Status.REQUEST_ENTITY_TOO_LARGE)

    def _serve_page(self, _, message, path, query):
        if path != "/":
            message.set_status(Soup.Status.NOT_FOUND, None)
        else:
            with open(PAGE, "rb") as page:
                message.set_status(Soup.Status.OK, None)
                message.set_response("text/html; charset=utf-8", Soup.MemoryUse.COPY, page.read())

    def _add_viewer(self, _, message, path, websocket):
        websocket.set_keepalive_interval(20)
        self._viewers.append(Viewer(websocket, self._capture, self._encode_key_frame, self._set_mode,
                                    self._viewers.remove))
        self._viewers[-1].send(name=self._name, mode=self._renderer.get_property("mode").value_nick)

    def _set_mode(self, mode):
        if mode not in [value.value_nick for value in self._renderer.get_property("mode").__enum_values__.values()]:
            raise ValueError(f"no mode {mode}")
        Gst.util_set_object_arg(self._renderer, "mode", mode)
        for viewer in self._viewers:
            viewer.send(mode=mode)

    def _encode_key_frame(self):
        self._encoder.send_event(
            GstVideo.video_event_new_upstream_force_key_unit(Gst.CLOCK_TIME_NONE, True, 0))

    def _send_rate(self, message):
        figures = message.get_structure()
        if figures.get_name() == "eventstats" and not figures.get_value("cumulative"):
            for viewer in self._viewers:
                viewer.send(rate=round(figures.get_value("rate")))


def main():
    parser = server_options("web-events", __doc__, "127.0.0.1", 8080)
    parser.add_argument("--host", action="append", default=[],
                        help="further name of this machine that browsers may use, besides localhost, its host"
                        " name and IP addresses; may be repeated")
    args = parser.parse_args()
    Gst.init(None)
    find_plugins()
    find_elements(ELEMENTS, "gstreamer1.0-plugins-good gstreamer1.0-plugins-bad gstreamer1.0-nice")
    Server(args.device, args.source, args.simulator, args.host).run(args.address, args.port)


if __name__ == "__main__":
    run(main)
