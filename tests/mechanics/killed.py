"""A checkpoint whose stage dies after so many generations."""

from mpm_core.stages.checkpoint import Checkpoint


class Killed(Exception):
    pass


class KilledAfter(Checkpoint):
    """Saves every generation and dies after so many of them."""

    left = 0

    def save(self, *arguments):
        self.cost = 0.0
        super().save(*arguments)
        self.left -= 1
        if self.left == 0:
            raise Killed
