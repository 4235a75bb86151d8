"""``python -m ibe_rl.viewer RUN...`` opens recordings again; see ``ibe_rl.view.viewer``."""

import signal
import sys

from ibe_rl.view.viewer import open_recordings

if __name__ == "__main__":
    if signal.getsignal(signal.SIGHUP) == signal.SIG_DFL:  # the terminal is closed, and it is not under nohup
        signal.signal(signal.SIGHUP, lambda *_: signal.raise_signal(signal.SIGTERM))
    sys.exit(open_recordings())
