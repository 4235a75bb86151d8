"""Importing it leaves all objects of now out of garbage collection: imported last where processes are copied.

Looking through what was imported costs a worker more than it can ever find there, and copies the memory.
"""

import gc

gc.freeze()
