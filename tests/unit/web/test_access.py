"""Who asks: the start key, sessions of browsers, and addresses that work once."""

from urc.web.serve.access import SESSIONS, UNKNOWN_VISITOR, Access, Visitor

URL = "http://127.0.0.1:8080/"


def cookie(access: Access, session: str) -> list[tuple[bytes, bytes]]:
    """Return the headers of a browser with that session."""
    return [(b"cookie", f"urc-language=de; {access.cookie}={session}".encode())]


def word_of(address: str) -> str:
    """Return what an address hands in."""
    assert address.startswith(f"{URL}?key=")
    return address.partition("=")[2]


def admitted(access: Access, address: str) -> Visitor:
    """Return who a browser is that opened an address."""
    session = access.admit(word_of(address))
    assert session is not None
    return access.visitor(cookie(access, session))


def test_the_printed_address_makes_a_browser_the_engineer_here() -> None:
    """Any number of browsers, each told apart from the others."""
    access = Access()
    first, second = (admitted(access, access.address(URL)) for _ in range(2))
    assert first.standing == second.standing == "here"
    assert first.name != second.name
    assert not first.is_program


def test_an_address_for_a_command_line_lets_in_one_browser() -> None:
    """Whoever reads it later finds it used, and the start key is not in it."""
    access = Access()
    address = access.address_once(URL)
    assert access.key not in address
    assert admitted(access, address).standing == "here"
    assert access.admit(word_of(address)) is None


def test_a_program_sends_the_key_with_each_request() -> None:
    """As a bearer token; any other is a stranger's."""
    access = Access()
    said = [(b"authorization", f"Bearer {access.key}".encode())]
    assert access.visitor(said) == Visitor("here", "program here", True)
    assert access.visitor([(b"authorization", b"Bearer guessed")]) == UNKNOWN_VISITOR
    assert access.visitor([(b"authorization", f"Basic {access.key}".encode())]) == UNKNOWN_VISITOR


def test_nothing_of_one_start_opens_the_next() -> None:
    """Neither key, nor session, nor code; the cookies of two servers have two names."""
    old, new = Access(), Access()
    session = old.admit(old.key)
    assert session is not None
    assert old.cookie != new.cookie
    assert new.visitor(cookie(old, session)) == UNKNOWN_VISITOR
    assert new.visitor(cookie(new, session)) == UNKNOWN_VISITOR
    assert new.admit(old.key) is None
    assert new.admit(word_of(old.address_once(URL))) is None
    assert new.admit("") is None


def test_a_cookie_is_out_of_reach_of_scripts_and_of_other_sites() -> None:
    """HttpOnly, SameSite=Strict, without an end of its own; over TLS it stays there."""
    access = Access(instance="1a2b3c4d")
    (plain,) = access.cookies("word", [], is_secure=False)
    assert plain == "urc-start-1a2b3c4d=word; Path=/; HttpOnly; SameSite=Strict"
    (secure,) = access.cookies("word", [], is_secure=True)
    assert secure == f"{plain}; Secure"


def test_cookies_of_many_starts_are_taken_away() -> None:
    """A browser that stays open for months would send them all for ever."""
    access = Access()
    many = "; ".join(f"urc-start-{number}=x" for number in range(9))
    few = "; ".join(f"urc-start-{number}=x" for number in range(8))
    assert len(access.cookies("word", [(b"cookie", few.encode())], is_secure=False)) == 1
    kept = access.cookies("word", [(b"cookie", many.encode())], is_secure=False)
    assert sum("Max-Age=0" in line for line in kept) == 9


def test_another_cookie_of_the_same_name_does_not_hide_ours() -> None:
    """Programs on other ports of a machine may set cookies for its name, too."""
    access = Access()
    session = access.admit(access.key)
    said = f"{access.cookie}=forged; {access.cookie}={session}"
    assert access.visitor([(b"cookie", said.encode())]).standing == "here"


def test_the_token_of_managers_makes_no_engineer() -> None:
    """It opens less than the start key, and without one nothing is open by an empty word."""
    access = Access(token="given-to-the-lab")  # noqa: S106
    assert admitted(access, access.address_of_managers(URL)).standing == "manager"
    assert Access().address_of_managers(URL) == ""
    assert Access().visitor([(b"authorization", b"Bearer ")]) == UNKNOWN_VISITOR


def test_the_number_of_sessions_is_bounded() -> None:
    """The browser that came first is forgotten, and must open the address again."""
    access = Access()
    first = access.admit(access.key)
    for _ in range(SESSIONS):
        last = access.admit(access.key)
    assert first is not None
    assert last is not None
    assert access.visitor(cookie(access, first)) == UNKNOWN_VISITOR
    assert access.visitor(cookie(access, last)).standing == "here"


def test_letters_outside_ascii_are_no_fault() -> None:
    """A header may hold any byte."""
    assert Access().visitor([(b"authorization", b"Bearer \xff\xfe")]) == UNKNOWN_VISITOR
    assert Access().admit("schlüssel\udce4".encode("utf-8", "replace").decode()) is None
