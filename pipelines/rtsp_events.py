#!/usr/bin/python3 -B
# SPDX-License-Identifier: LGPL-2.1-or-later
"""Serves the events and the video of a camera over RTSP to any number of clients, until Ctrl-C:

    rtsp-events --device /dev/video0

    rtsp://HOST:8554/events   the events
    rtsp://HOST:8554/picture  the events, drawn as H.264 video for any player
    rtsp://HOST:8554/video    the video of the camera
    rtsp://HOST:8554/both     events and video in one session, synchronized by RTCP

Without --device or --source it serves a test scene; of a recording, only events and picture. With --certificate, it
serves rtsps:// only."""
import os
import sys

# GIO's TLS has no other setting for its versions, and would take 1.0 and 1.1.
os.environ.setdefault("G_TLS_GNUTLS_PRIORITY", "NORMAL:%COMPAT:-VERS-TLS1.0:-VERS-TLS1.1")

try:
    import gi

    gi.require_version("Gst", "1.0")
    gi.require_version("GstRtsp", "1.0")
    gi.require_version("GstRtspServer", "1.0")
    from gi.repository import Gio, GLib, Gst, GstRtsp, GstRtspServer
except (ImportError, ValueError) as missing:
    sys.exit(f"error: {missing}\nOn Debian, install: python3-gi gir1.2-gst-plugins-base-1.0"
             " gir1.2-gst-rtsp-server-1.0")

from capture import Capture, Source, described, host_of, server_options  # noqa: E402
from program import find_elements, find_plugins, run  # noqa: E402

ELEMENTS = ["vp8enc", "rtpvp8pay",
            "x264enc", "rtph264pay"]

EVENTS_CAPTURED = "application/x-event-camera"
# A format that every simulator and the encoder support.
CAPTURED = "videoconvert ! video/x-raw,format=I420"
# The appsrc drops frames while a client pauses; the queues drop them if a simulator or an encoder is too slow.
FRAMES = ("appsrc name=frames is-live=true format=time leaky-type=downstream max-buffers={buffers} max-bytes=0"
          " max-time=0")
QUEUE = "queue leaky=downstream max-size-buffers={buffers}"
EVENTS = f"{QUEUE} ! {{simulator}} ! application/x-event-camera"
# RTSP clients cannot request a key frame, so there is one every second.
PICTURE = ("eventrender ! video/x-raw,framerate=30/1 ! videoconvert ! video/x-raw,format=I420 ! queue"
           " ! x264enc tune=zerolatency speed-preset=veryfast bitrate=4000 key-int-max=30 ! rtph264pay config-interval=-1")
VIDEO = (f"{QUEUE} ! videoconvert ! vp8enc deadline=1 cpu-used=8 threads=2 target-bitrate=4000000"
         " keyframe-max-dist=30 ! rtpvp8pay picture-id-mode=15-bit")
MEDIA = {
    "/events": f"{FRAMES} ! {EVENTS} ! rtpeventpay name=pay0",
    "/picture": f"{FRAMES} ! {EVENTS} ! {PICTURE} name=pay0",
    "/video": f"{FRAMES} ! {VIDEO} name=pay0",
    "/both": f"{FRAMES} ! tee name=t  t. ! {EVENTS} ! rtpeventpay name=pay0  t. ! {VIDEO} name=pay1",
}
VIEWER = "viewer"
SECONDS_BETWEEN_CLEANUPS = 5


class Server:
    """RTSP server: clients of a path share its media, and all media share the camera."""

    def __init__(self, device, source, simulator):
        source = Source(device, source)
        self._capture = Capture(device, source, EVENTS_CAPTURED if source.has_events else CAPTURED)
        self._paths = ("/events", "/picture") if source.has_events else tuple(MEDIA)
        self._server = GstRtspServer.RTSPServer()
        permissions = GstRtspServer.RTSPPermissions.new()
        for permission in ("media.factory.access", "media.factory.construct"):
            permissions.add_permission_for_role(VIEWER, permission, True)
        for path in self._paths:
            # A recording comes in buffers of 10 ms, none of which is dropped for another.
            launch = MEDIA[path].format(**({"simulator": "identity", "buffers": 100} if source.has_events
                                           else {"simulator": simulator, "buffers": 2}))
            # Reports errors at the start, not to the first client.
            Gst.parse_launch_full(launch, None, Gst.ParseFlags.FATAL_ERRORS)
            factory = GstRtspServer.RTSPMediaFactory()
            factory.set_launch(f"( {launch} )")
            factory.set_shared(True)
            factory.set_permissions(permissions)
            factory.connect("media-configure", self._feed)
            self._server.get_mount_points().add_factory(path, factory)

    def protect(self, user, password, certificate):
        auth = GstRtspServer.RTSPAuth.new()
        token = GstRtspServer.RTSPToken.new()
        token.set_string("media.factory.role", VIEWER)
        if user is not None:
            auth.set_supported_methods(GstRtsp.RTSPAuthMethod.DIGEST)
            auth.add_digest(user, password, token)
        else:
            auth.set_default_token(token)
        if certificate:
            pair = Gio.TlsCertificate.new_from_file(certificate)
            if pair.get_property("private-key-pem") is None:  # the first client would crash the server
                raise RuntimeError(f"{certificate} has no private key; append it: cat cert.pem key.pem > both.pem")
            auth.set_tls_certificate(pair)
        self._server.set_auth(auth)

    def run(self, address, port, scheme):
        self._server.set_address(str(address))
        self._server.set_service(str(port))
        if self._server.attach(None) == 0:
            raise RuntimeError(f"cannot listen on {address}, port {port}, which may be in use; "
                               "choose another with --port")
        self._capture.start()
        base = f"{scheme}://{host_of(address)}:{self._server.get_bound_port()}"
        print(f"Serving {', '.join(base + path for path in self._paths)} until Ctrl-C", flush=True)
        sessions = self._server.get_session_pool()
        GLib.timeout_add_seconds(SECONDS_BETWEEN_CLEANUPS, lambda: sessions.cleanup() >= 0)
        try:
            self._capture.run()
        finally:
            self._server.client_filter(lambda *_: GstRtspServer.RTSPFilterResult.REMOVE)
            sessions.filter(lambda *_: GstRtspServer.RTSPFilterResult.REMOVE)
            # Waits for the threads that call the handler connected in _feed.
            GstRtspServer.RTSPThreadPool.cleanup()

    def _feed(self, _, media):
        element = media.get_element()
        frames = element.get_by_name("frames")
        pipeline = element.get_parent()
        bus = pipeline.get_bus()
        bus.enable_sync_message_emission()  # the media takes messages from the bus
        bus.connect("sync-message::error", lambda _, message: print(f"error: {described(message)}", file=sys.stderr))
        self._capture.attach(frames, pipeline)
        media.connect("unprepared", lambda _: self._capture.detach(frames))


def main():
    parser = server_options("rtsp-events", __doc__, "0.0.0.0", 8554)
    parser.add_argument("--user", help="user name that clients must log in with")
    parser.add_argument("--password", help="password of that user")
    parser.add_argument("--certificate", metavar="PEM",
                        help="TLS certificate and its private key, in one file")
    args = parser.parse_args()
    if (args.user is None) != (args.password is None):
        parser.error("--user and --password need each other")
    if args.user == "":
        parser.error("--user is empty")
    Gst.init(None)
    find_plugins()
    find_elements(ELEMENTS, "gstreamer1.0-plugins-good gstreamer1.0-plugins-ugly")
    server = Server(args.device, args.source, args.simulator)
    if args.user is not None or args.certificate:
        server.protect(args.user, args.password, args.certificate)
    server.run(args.address, args.port, "rtsps" if args.certificate else "rtsp")


if __name__ == "__main__":
    run(main)
