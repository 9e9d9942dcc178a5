"""The sign-in methods of one server and their routes.

Layer 5. The start key, pairing and passphrases need no options; an identity provider and trusted
proxies do.
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
    """Options for the sign-in methods."""

    oidc: OidcOptions | None = None
    """Options for the identity provider; None if there is no provider."""
    proxies: tuple[TrustedProxy, ...] = ()
    """Trusted proxies, which identify the person behind each request."""


class WaysIn:
    """The sign-in methods of one server."""

    def __init__(self, access: Access, recorder: ServerRecorder, options: SignInOptions) -> None:
        """Create the sign-in methods that the options enable.

        Args:
            access: identities and rights.
            recorder: recorder that writes sign-ins to the audit log.
            options: the options.

        Raises:
            AccessError: an extra that a sign-in method needs is not installed.
        """
        self.options = options
        recorder.hide(one.secret.decode() for one in options.proxies)
        recorder.hide([options.oidc.client_secret] if options.oidc else [])
        self.sign_ins = BrowserSignIns(access, recorder)
        """The object that all sign-in methods share, for limits, audit entries and sign-ins."""
        provider = OidcSignIn(options.oidc) if options.oidc else None
        self.oidc = OidcRoutes(self.sign_ins, provider)
        self._passkeys = PasskeyRoutes(self.sign_ins)

    def routes(self) -> list[ProtectedRoute]:
        """Return the routes."""
        return [*self._passkeys.routes(), *self.oidc.routes()]
