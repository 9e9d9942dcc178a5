"""Third-party web servers for the tests: lighttpd with scripts, ffmpeg as a camera."""

import shutil
from hashlib import md5
from pathlib import Path

from tests.e2e.ports import free_port
from tests.e2e.transports.processes import Server

__all__ = ["camera", "lighttpd"]

USER, PASSWORD, REALM = "operator", "s3cret", "robot"

CONFIG = """
server.document-root = "{root}"
server.port = {port}
server.bind = "127.0.0.1"
server.modules = ("mod_auth", "mod_authn_file", "mod_cgi", "mod_redirect")
server.stream-response-body = 2
server.max-keep-alive-idle = 60
mimetype.assign = (".json" => "application/json", ".jpg" => "image/jpeg")
cgi.assign = (".cgi" => "/bin/sh")
url.redirect = ("^/moved" => "http://127.0.0.1:1/elsewhere")
auth.backend.plain.userfile = "{root}/../plain"
auth.backend.htdigest.userfile = "{root}/../htdigest"
$HTTP["url"] =~ "^/basic/" {{
  auth.backend = "plain"
  auth.require = ("/" => ("method" => "basic", "realm" => "{realm}", "require" => "valid-user"))
}}
$HTTP["url"] =~ "^/digest/" {{
  auth.backend = "htdigest"
  auth.require = ("/" => ("method" => "digest", "realm" => "{realm}", "require" => "valid-user"))
}}
"""

SCRIPTS = {
    "echo.cgi": """
printf 'Content-Type: text/plain\\r\\n\\r\\n'
printf '%s %s %s ' "$REQUEST_METHOD" "$QUERY_STRING" "$HTTP_X_ROBOT"
cat
""",
    "busy.cgi": """
printf 'Status: 503 Service Unavailable\\r\\nContent-Type: text/plain\\r\\n\\r\\n'
echo 'the arm is moving'; echo 'try again'
""",
    # Each connection gives three events and ends; it goes on after the last one that was seen.
    "events.cgi": """
printf 'Content-Type: text/event-stream\\r\\n\\r\\n'
last=${HTTP_LAST_EVENT_ID:-0}
echo 'retry: 100'; echo
for i in 1 2 3; do
  n=$((last + i))
  printf 'id: %s\\nevent: battery\\ndata: %s\\n\\n' $n $((100 - n))
  printf 'data: {"tick":\\ndata: %s}\\n\\n' $n
done
""",
    "lines.cgi": """
printf 'Content-Type: text/plain\\r\\n\\r\\n'
n=0; while [ $n -lt 50 ]; do n=$((n + 1)); echo "line $n"; sleep 0.01; done
""",
    "slow.cgi": """
sleep 30
""",
    "flood.cgi": """
printf 'Content-Type: application/octet-stream\\r\\n\\r\\n'
exec cat /dev/zero
""",
}


def lighttpd(folder: Path) -> Server:
    """Prepare a web server in `folder`, with what the tests ask for."""
    program = shutil.which("lighttpd") or "/usr/sbin/lighttpd"
    root, port = folder / "www", free_port()
    for name in ("basic", "digest"):
        (root / name).mkdir(parents=True)
        (root / name / "state.json").write_text('{"battery": 87}')
    (root / "state.json").write_text('{"battery": 87}')
    for name, text in SCRIPTS.items():
        (root / name).write_text(text.lstrip())
    (folder / "plain").write_text(f"{USER}:{PASSWORD}\n")
    secret = md5(f"{USER}:{REALM}:{PASSWORD}".encode(), usedforsecurity=False).hexdigest()
    (folder / "htdigest").write_text(f"{USER}:{REALM}:{secret}\n")
    config = folder / "lighttpd.conf"
    config.write_text(CONFIG.format(root=root, port=port, realm=REALM))
    return Server([program, "-D", "-f", str(config)], port, folder / "lighttpd.log")


def camera(port: int) -> list[str]:
    """Return the command of a camera at ``/cam``: it serves one client, and ends with it."""
    picture = "testsrc2=size=320x240:rate=30"
    kind = "multipart/x-mixed-replace;boundary=ffmpeg"
    server = ["-listen", "1", f"http://127.0.0.1:{port}/cam"]
    source = ["-re", "-f", "lavfi", "-i", picture, "-c:v", "mjpeg", "-f", "mpjpeg"]
    return ["ffmpeg", "-v", "error", *source, "-content_type", kind, *server]
