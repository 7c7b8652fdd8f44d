"""The one exception that a user is meant to read."""


class InputError(Exception):
    """A user's mistake or a scene that cannot be solved: one line that says where, what, and what to do."""

    def __init__(self, message: str):
        super().__init__(" ".join(message.split()))
