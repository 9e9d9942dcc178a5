"""The ways to sign in of one server, and their routes.

Layer 5. The start key, pairing and passphrases need no options; a provider and proxies do.
"""

from typing import NamedTuple

from urc.access.oidc import OidcSignIn
from urc.access.oidc_options import OidcOptions
from urc.access.proxies import TrustedProxy
from urc.runtime.server_recorder import ServerRecorder
from urc.web.people.browser_sign_ins import BrowserSignIns
from urc.web.people.oidc_routes import OidcRoutes
from urc.web.people.passkey_routes import PasskeyRoutes
from urc.web.serve.access import Access
from urc.web.serve.rights import ProtectedRoute

__all__ = ["SignInOptions", "WaysIn"]


class SignInOptions(NamedTuple):
    """Options of the ways to sign in."""

    oidc: OidcOptions | None = None
    """The identity provider, or None."""
    proxies: tuple[TrustedProxy, ...] = ()
    """Proxies that name the person of a request."""


class WaysIn:
    """The ways to sign in."""

    def __init__(self, access: Access, recorder: ServerRecorder, options: SignInOptions) -> None:
        """Prepare.

        Args:
            access: identities and rights.
            recorder: recorder of sign-ins in the audit log.
            options: the options.

        Raises:
            AccessError: an extra package is missing.
        """
        self.options = options
        recorder.hide(one.secret.decode() for one in options.proxies)
        recorder.hide([options.oidc.client_secret] if options.oidc else [])
        self.sign_ins = BrowserSignIns(access, recorder)
        """The end of every way to sign in."""
        provider = OidcSignIn(options.oidc) if options.oidc else None
        self.oidc = OidcRoutes(self.sign_ins, provider)
        self._passkeys = PasskeyRoutes(self.sign_ins)

    def routes(self) -> list[ProtectedRoute]:
        """Return the routes."""
        return [*self._passkeys.routes(), *self.oidc.routes()]
