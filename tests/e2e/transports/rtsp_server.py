"""A camera by GStreamer's RTSP server, for Debian's Python: `gi` is no package of the registry.

    python3 rtsp_server.py PORT SIZE GROUP [rate=KBIT] [USER PASSWORD SCHEME]

SIZE is WIDTHxHEIGHT, GROUP the number of images between two keyframes. The path is /cam. With a
rate, the film is noise, so that the encoder needs it.
"""

import sys

import gi

for name in ("Gst", "GstRtsp", "GstRtspServer"):
    gi.require_version(name, "1.0")
from gi.repository import GLib, Gst, GstRtsp, GstRtspServer  # noqa: E402 - after its version

Gst.init(None)
port, size, group, *login = sys.argv[1:]
width, height = size.split("x")
rate = int(login.pop(0)[5:]) if login and login[0].startswith("rate=") else 0
pattern, bits = ("snow", f" bitrate={rate} vbv-buf-capacity=300") if rate else ("smpte", "")
film = GstRtspServer.RTSPMediaFactory()
film.set_shared(True)
film.set_launch(
    f"( videotestsrc is-live=true pattern={pattern}"
    f" ! video/x-raw,width={width},height={height},framerate=30/1"
    f" ! x264enc tune=zerolatency speed-preset=ultrafast key-int-max={group}{bits}"
    " ! rtph264pay name=pay0 pt=96 config-interval=0 )"
)
server = GstRtspServer.RTSPServer()
server.set_address("127.0.0.1")
server.set_service(port)
if login:
    user, password, scheme = login
    role = GstRtspServer.RTSPToken()
    role.set_string("media.factory.role", "viewer")
    rights = GstRtspServer.RTSPPermissions()
    for right in ("access", "construct"):
        rights.add_permission_for_role("viewer", f"media.factory.{right}", True)
    film.set_permissions(rights)
    auth = GstRtspServer.RTSPAuth()
    if scheme == "digest":
        auth.set_supported_methods(GstRtsp.RTSPAuthMethod.DIGEST)
        auth.add_digest(user, password, role)
    else:
        auth.add_basic(GstRtspServer.RTSPAuth.make_basic(user, password), role)
    server.set_auth(auth)
server.get_mount_points().add_factory("/cam", film)
server.attach(None)
GLib.MainLoop().run()
