"""URC: describe a robot in one YAML file, and drive it from any browser.

The package `urc` itself exports only the public names for Python programs. Other modules are
imported on first use, because ``urc --version`` must not load a web server.
"""

TYPE_CHECKING = False  # for type checkers; importing `typing` would slow down --version
if TYPE_CHECKING:
    from urc.client.local import connect, load

__version__ = "0.1.0"
__all__ = ["__version__", "connect", "load"]


def __getattr__(name: str) -> object:
    if name in ("connect", "load"):
        from urc.client import local

        return getattr(local, name)
    raise AttributeError(f"module 'urc' has no attribute {name!r}")
