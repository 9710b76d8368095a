"""What axe-core finds in a page that hinders people with disabilities."""

from axe_playwright_python.sync_playwright import Axe

WIDTHS = [1400, 390]  # a desktop's window, and a phone's


def faults(tab):
    """Return axe-core's faults of an open page: (rule, the elements that break it)."""
    results = Axe().run(tab).response
    assert results["passes"]
    return [
        (violation["id"], [node["target"] for node in violation["nodes"]])
        for violation in results["violations"]
    ]
