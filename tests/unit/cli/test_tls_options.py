"""Which certificate the options of the command line mean."""

import argparse
from pathlib import Path

import pytest

from urc.cli.arguments import add_host
from urc.cli.error_report import Misuse
from urc.cli.tls_options import TlsOptions, add_tls, tls_of


def parsed(*words: str) -> TlsOptions:
    """Return the options in a command line."""
    parser = argparse.ArgumentParser()
    add_host(parser)
    add_tls(parser)
    return tls_of(parser.parse_args(words))


FILES = ("--tls-cert", "c.pem", "--tls-key", "k.pem")


@pytest.mark.parametrize(
    ("words", "kind"),
    [
        ((), "plain"),
        (("--host", "localhost"), "plain"),
        (("--host", "::1"), "plain"),
        (("--tls", "auto"), "local"),
        (("--host", "0.0.0.0"), "local"),
        (("--host", "192.168.4.1"), "local"),
        (("--host", "robot-pi"), "local"),
        (("--host", "0.0.0.0", "--insecure-plain-http"), "plain"),
        (("--host", "0.0.0.0", *FILES), "given"),
        (FILES, "given"),
        (("--behind-proxy", "robots.example"), "plain"),
        (("--host", "0.0.0.0", "--behind-proxy", "robots.example"), "local"),
    ],
)
def test_only_this_machine_gets_plain_http_unless_it_is_asked_for(
    words: tuple[str, ...], kind: str
) -> None:
    assert parsed(*words).kind == kind


def test_files_and_names_are_kept() -> None:
    options = parsed(*FILES, "--behind-proxy", "robots.example", "--behind-proxy", "r.lab:8443")
    assert (options.chain, options.key) == (Path("c.pem"), Path("k.pem"))
    assert options.hosts() == ["robots.example", "r.lab"]


@pytest.mark.parametrize(
    ("words", "text"),
    [
        (("--tls-cert", "c.pem"), "--tls-cert and --tls-key require each other"),
        (("--tls-key", "k.pem"), "--tls-cert and --tls-key require each other"),
        (("--tls", "auto", *FILES), "--tls auto makes a certificate"),
        (("--insecure-plain-http", "--tls", "auto"), "--insecure-plain-http turns HTTPS off"),
        (("--insecure-plain-http", *FILES), "--insecure-plain-http turns HTTPS off"),
        (("--behind-proxy", "https://robots.example/"), "expected a name like robots.example"),
    ],
)
def test_contradictions_are_refused(words: tuple[str, ...], text: str) -> None:
    with pytest.raises(Misuse, match=text):
        parsed(*words)
