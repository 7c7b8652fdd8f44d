"""The sections of the report's appendix: each is a module here with a template of the same name beside it.

To add one, write both and name it in TOPICS. A module offers `section(evidence, gallery)`: what
its template shows under the section's name, with figures saved in the gallery.
"""

MAX_ROWS_UNFOLDED = 40  # A longer table is folded, or scrolls.
TOPICS = {  # in the page's order: topic, and its sections by id in the page with their names in the contents
    "Before you use the numbers": {"warnings": "Warnings", "record": "Record and comparison"},
    "Mine and rock": {
        "scene": "Scene and grid",
        "view": "View",
        "rock": "Failed rock",
        "planes": "Chosen sections",
        "openings": "Openings",
        "observations": "Instruments",
    },
    "Events": {
        "steps": "Steps",
        "events": "Places",
        "sizes": "Sizes",
        "axes": "Axes",
        "balls": "Largest events",
        "parameters": "Source parameters",
    },
    "How sure": {
        "uncertainty": "Uncertainty",
        "convergence": "Convergence",
        "spread": "Spread of the model",
        "forecasts": "Forecasts and what came",
        "truncated": "Truncated zones",
        "budget": "Potency budget",
    },
    "Openings and support": {"shaking": "Shaking and demand on support", "loading": "Loading measures"},
    "The run": {"resources": "Resources", "config": "Configuration"},
}
SECTIONS = {section: name for topic in TOPICS.values() for section, name in topic.items()}


def section_number(section: str) -> int:
    """Number of a section, from 1, by its id."""
    return list(SECTIONS).index(section) + 1
