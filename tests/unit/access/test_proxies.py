"""Headers of proxies: believed with the secret only, and removed in every case."""

from pathlib import Path

import pytest

from urc.access.grants import Grant
from urc.access.proxies import TrustedProxy, read_proxy_options, without_proxy_headers
from urc.problems import ProblemsError

SECRET = "0123456789abcdef" * 2
GATE = TrustedProxy("gate", b"x-forwarded-user", b"x-gate-secret", SECRET.encode())
OTHER = TrustedProxy("other", b"remote-user", b"x-other-secret", b"another secret")
REST = [(b"host", b"robots.example"), (b"cookie", b"a=b")]
USER, KEY = (b"x-forwarded-user", b"ann"), (b"x-gate-secret", SECRET.encode())


def test_a_name_counts_with_the_secret() -> None:
    found = without_proxy_headers([USER, *REST, KEY], [GATE, OTHER])
    assert (found.proxy, found.user, found.fault) == (GATE, "ann", "")
    assert found.headers == REST


@pytest.mark.parametrize(
    ("headers", "fault"),
    [
        ([USER], "came without the secret of the proxy"),
        ([USER, (b"x-gate-secret", b"guess")], "came without the secret of the proxy"),
        ([USER, (b"x-gate-secret", b"")], "came without the secret of the proxy"),
        ([USER, KEY, KEY], "came without the secret of the proxy"),
        ([USER, KEY, (b"x-gate-secret", b"guess")], "came without the secret of the proxy"),
        ([USER, (b"x-forwarded-user", b"eve"), KEY], "sent the header x-forwarded-user 2 times"),
        ([(b"remote-user", b"ann"), KEY], "remote-user came without the secret"),
        ([USER, (b"x-other-secret", SECRET.encode())], "came without the secret"),
        ([(b"x-gate-secret", b"guess")], "came without the secret of the proxy"),
    ],
)  # fmt: skip
def test_without_proof_nobody_is_named(headers: list[tuple[bytes, bytes]], fault: str) -> None:
    found = without_proxy_headers([*headers, *REST], [GATE, OTHER])
    assert found.headers == REST, "nothing behind this point sees the headers"
    assert fault in found.fault
    # The secret alone, without a name, proves the proxy and no person.
    assert found.user == ""


def test_a_proven_proxy_may_name_nobody() -> None:
    found = without_proxy_headers([*REST, KEY], [GATE])
    assert (found.proxy, found.user, found.fault) == (GATE, "", "")


def test_a_request_without_headers_of_proxies_stays_as_it_is() -> None:
    assert without_proxy_headers(REST, [GATE]) == (REST, None, "", "")


def test_two_proxies_at_once_prove_nothing() -> None:
    both = [USER, KEY, (b"remote-user", b"eve"), (b"x-other-secret", b"another secret")]
    found = without_proxy_headers(both, [GATE, OTHER])
    assert (found.headers, found.proxy, found.user) == ([], None, "")
    assert "several proxies" in found.fault


def test_the_secret_is_not_shown() -> None:
    assert SECRET not in repr(GATE)


GOOD = """
name: gate
user_header: X-Forwarded-User
secret_header: X-Gate-Secret
secret_file: secret
new_people: [watch, "drive@#lab"]
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "secret").write_text(SECRET + "\n")
    (tmp_path / "secret").chmod(0o600)
    return tmp_path


def read(folder: Path, text: str) -> TrustedProxy:
    (folder / "proxy.yaml").write_text(text)
    return read_proxy_options(str(folder / "proxy.yaml"))


def test_a_proxy_is_read_from_a_file(folder: Path) -> None:
    proxy = read(folder, GOOD)
    assert proxy == TrustedProxy(
        "gate", b"x-forwarded-user", b"x-gate-secret", SECRET.encode(),
        (Grant("watch"), Grant("drive", "#lab")),
    )  # fmt: skip
    assert read(folder, GOOD[: GOOD.index("new_people")]).new_people == ()


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("secret_file: secret\n", "", "'secret_file' is missing"),
        ("X-Forwarded-User", "Cookie", "expected a dedicated header"),
        ("X-Forwarded-User", "X Forwarded", "expected a dedicated header"),
        ("X-Gate-Secret", "x-forwarded-user", "expected a header other than user_header"),
        ("X-Gate-Secret", "Authorization", "expected a dedicated header"),
        ("[watch,", "[fly,", "new_people.0: expected a role"),
        ("[watch,", "[1,", "expected a grant such as watch, found 1"),
        ("name: gate\n", "", "'name' is missing"),
        ("name:", "nam:", "unknown key 'nam'"),
    ],
)
def test_each_mistake_has_its_line(folder: Path, old: str, new: str, message: str) -> None:
    with pytest.raises(ProblemsError) as error:
        read(folder, GOOD.replace(old, new))
    assert message in str(error.value)


def test_a_short_secret_is_refused(folder: Path) -> None:
    (folder / "secret").write_text("short")
    with pytest.raises(ProblemsError, match="expected 32 to 4096 characters"):
        read(folder, GOOD)
