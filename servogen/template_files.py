"""Where the templates of the C, the pages and the films are."""

from pathlib import Path


def template_folder() -> Path:
    """Return `templates/`: inside the package when installed from a wheel, beside it in a checkout."""
    package = Path(__file__).parent
    inside = package / "templates"
    return inside if inside.is_dir() else package.parent / "templates"
