"""Recordings in the browser: the process that serves one while it grows, and the curves of several runs."""

from ibe_rl.serve.relay import Ports, Relay, choose_ports, invitation

__all__ = ["Ports", "Relay", "choose_ports", "invitation"]
