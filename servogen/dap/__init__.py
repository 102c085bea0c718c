"""A debug adapter: editors debug the simulated chip, forwards and backwards (Debug Adapter Protocol)."""

from servogen.dap.protocol import Messages, serve
from servogen.dap.session import DebugSession, Loaded

__all__ = ["DebugSession", "Loaded", "Messages", "serve"]
