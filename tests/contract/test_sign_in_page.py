"""The files on the page about ways to sign in are valid, and name every option."""

from pathlib import Path

from tests.documentation import ROOT, blocks
from urc.access import oidc_options, proxies

PAGE = ROOT / "docs" / "sign-in.md"
OIDC, PROXY = (one.text for one in blocks(PAGE) if one.language == "text")


def private(file: Path, text: str) -> None:
    file.write_text(text)
    file.chmod(0o600)


def test_the_file_of_a_provider_is_valid_and_whole(tmp_path: Path) -> None:
    private(tmp_path / "oidc-secret", "secret")
    (tmp_path / "lab-ca.pem").write_text("")
    (tmp_path / "oidc.yaml").write_text(OIDC)
    options = oidc_options.read_oidc_options(str(tmp_path / "oidc.yaml"))
    assert [str(rule.grant) for rule in options.rules] == ["drive@#lab", "administer", "watch"]
    keys = {line.partition(":")[0] for line in OIDC.splitlines() if not line.startswith(" ")}
    assert keys == set(oidc_options.KEYS)


def test_the_file_of_a_proxy_is_valid_and_whole(tmp_path: Path) -> None:
    private(tmp_path / "proxy-secret", "s" * 32)
    (tmp_path / "proxy.yaml").write_text(PROXY)
    assert proxies.read_proxy_options(str(tmp_path / "proxy.yaml")).name == "gateway"
    keys = {line.partition(":")[0] for line in PROXY.splitlines()}
    assert keys == set(proxies.KEYS)
