"""The sections of the appendix by topic, for its contents, its headings and sentences that refer to a section."""

TOPICS = {  # in the page's order: topic, and its sections by id in the page with their names in the contents
    "Before you use the numbers": {"warnings": "Warnings", "record": "Record and comparison"},
    "Mine and rock": {"scene": "Scene and grid", "view": "View", "rock": "Failed rock"},
    "Events": {
        "steps": "Steps",
        "events": "Places",
        "sizes": "Sizes",
        "axes": "Axes",
        "balls": "Largest events",
    },
    "How sure": {
        "convergence": "Convergence",
        "spread": "Spread of the model",
        "forecasts": "Forecasts and what came",
        "truncated": "Truncated zones",
        "budget": "Potency budget",
    },
    "The run": {"resources": "Resources", "config": "Configuration"},
}
SECTIONS = {section: name for topic in TOPICS.values() for section, name in topic.items()}


def section_number(section: str) -> int:
    """Number of a section, from 1, by its id."""
    return list(SECTIONS).index(section) + 1
