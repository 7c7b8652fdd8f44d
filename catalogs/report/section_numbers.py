"""The report's sections and their numbers, for its contents, its headings and sentences that refer to a section."""

SECTIONS = {  # by id in the page, in its order: name in the contents
    "headline": "Result",
    "scene": "Scene",
    "view": "View",
    "convergence": "Convergence",
    "rock": "Failed rock",
    "events": "Events",
    "sizes": "Sizes",
    "spread": "Spread",
    "axes": "Axes",
    "balls": "Largest events",
    "budget": "Budget",
    "truncated": "Truncated zones",
    "resources": "Resources",
    "config": "Configuration",
}


def section_number(section: str) -> int:
    """Number of a section, from 1, by its id."""
    return list(SECTIONS).index(section) + 1
