import numpy as np


class Beside:
    def __init__(self, first, others):
        self.first, self.others = first, others

    def reset(self, rows):
        if rows[0]:
            self.first.reset(rows[:1])
        if len(rows) > 1:
            self.others.reset(rows[1:])

    def instruct(self, states, rows):
        a = self.first.instruct(states[:1], rows[:1])
        if len(rows) == 1:
            return a
        b = self.others.instruct(states[1:], rows[1:])
        return np.concatenate([a[0], b[0]]), np.concatenate([a[1], b[1]])
