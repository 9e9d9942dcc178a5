"""What the options of ssh and telnet mean, and what is said of those that mean nothing."""

import pytest

from urc.transports.base import TransportError, TransportSetup
from urc.transports.ssh import RemoteProgram, from_setup, read_program, read_target
from urc.transports.ssh_login import Login
from urc.transports.telnet import from_setup as telnet_from_setup

GOOD = {"host": "10.0.0.5", "username": "robot"}
PIN = "SHA256:JeYcKNp6EW5kp431CgbezSP+f+P3DNnckAtJioFcWEI"


def test_least_that_ssh_needs() -> None:
    """Port 22, and a shell with a terminal."""
    setup = TransportSetup("jump", GOOD)
    target = read_target(setup)
    assert (target.address.text, target.login) == ("10.0.0.5:22", Login("robot"))
    assert (target.keepalive_s, target.keys.is_pinned) == (2.0, False)
    assert read_program(setup) == RemoteProgram("shell", "", True, ())
    assert from_setup(setup).address == "ssh 10.0.0.5:22"


def test_command_has_no_terminal_unless_it_is_wanted() -> None:
    """Its output is to be what it writes."""
    exec_ = GOOD | {"mode": "exec", "command": "cat", "environment": {"LANG": "C"}}
    assert read_program(TransportSetup("x", exec_)) == RemoteProgram(
        "exec", "cat", False, (("LANG", "C"),)
    )
    assert read_program(TransportSetup("x", exec_ | {"pty": True})).has_pty


def test_secrets_stay_out_of_what_is_printed() -> None:
    """A login may end up in a traceback."""
    login = Login("robot", password="sesame", key="-----BEGIN", passphrase="horse")  # noqa: S106
    assert repr(login) == "Login('robot')"
    assert "sesame" not in f"{login} {login!s} {read_target(TransportSetup('x', GOOD))}"


@pytest.mark.parametrize(
    ("options", "complaint"),
    [
        ({"host": ""}, "ssh: host must be a host name or address, not ''"),
        ({"port": 0}, "ssh: port must be an integer from 1 to 65535, not 0"),
        ({"username": None}, "ssh needs a username"),
        ({"password": 1234}, "ssh: password must be text; put the value in quotation marks"),
        ({"mode": "sftp"}, "ssh: mode must be shell | exec | forward, not 'sftp'"),
        ({"mode": "exec"}, "ssh: 'mode: exec' needs a command"),
        ({"command": "cat"}, "ssh: a command needs 'mode: exec', not 'mode: shell'"),
        ({"pty": "yes"}, "ssh: pty must be true or false, not 'yes'"),
        (
            {"keepalive_interval": "2h"},
            "ssh: keepalive_interval must be a time from 200ms to 1m, not '2h'",
        ),
        (
            {"keepalive_interval": 5},
            "ssh: keepalive_interval must be a time from 200ms to 1m, not 5",
        ),
        ({"environment": "A=b"}, "ssh: environment must contain entries of the form NAME: value"),
        ({"environment": {"A B": "c"}}, "ssh: 'A B' is not the name of an environment variable"),
        (
            {"environment": {"A": 1}},
            "ssh: environment.A must be text; put the value in quotation marks",
        ),
        (
            {"host_key": "aa:bb"},
            "ssh: host_key is a fingerprint as 'ssh-keygen -l' prints it, SHA256:…, not 'aa:bb'",
        ),
    ],
)
def test_bad_option_of_ssh_is_told(options: dict[str, object], complaint: str) -> None:
    """In one line, and a secret is not repeated."""
    with pytest.raises(TransportError) as told:
        from_setup(TransportSetup("jump", GOOD | options))
    assert str(told.value) == complaint


@pytest.mark.parametrize(
    ("options", "complaint"),
    [
        ({"host": 5}, "telnet: host must be a host name or address, not 5"),
        ({"negotiate": "never"}, "telnet: negotiate must be full | passive, not 'never'"),
        ({"echo": 1}, "telnet: echo must be true or false, not 1"),
        (
            {"terminal": "VT\x1b"},
            "telnet: terminal must be a name of up to 40 ASCII characters, not 'VT\\x1b'",
        ),
    ],
)
def test_bad_option_of_telnet_is_told(options: dict[str, object], complaint: str) -> None:
    """In one line."""
    with pytest.raises(TransportError) as told:
        telnet_from_setup(TransportSetup("console", {"host": "10.0.0.5"} | options))
    assert str(told.value) == complaint
