import json


class LessonWriter:
    def __init__(self, path):
        self.path = path

    def write(self, episode, instructions, given, by, heard):
        with self.path.open("a") as f:
            f.write(
                json.dumps({"episode": episode, "instructions": instructions, "given": given, "by": by, "heard": heard})
                + "\n"
            )
