"""A run as a rerun recording: what is drawn and said, and the file that it goes to."""

from ibe_rl.view.film import SILENCE
from ibe_rl.view.recorder import Recorder
from ibe_rl.view.recording_file import set_back
from ibe_rl.view.run_recorder import RunRecorder
from ibe_rl.view.sentences import short

__all__ = ["SILENCE", "Recorder", "RunRecorder", "set_back", "short"]
