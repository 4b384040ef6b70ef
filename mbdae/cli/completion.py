"""What the tab key completes: models, methods and formulations by name, found without an import that takes time."""

from collections.abc import Callable, Iterable

from click import Context, Parameter
from click.shell_completion import CompletionItem

from ..discovery import entry_points_of, instances, model_names, public

FORMULATIONS = ("index2", "ggl", "index1")
COMPARED = ("index2", "project", "ggl")  # in which a comparison has half-explicit methods

Completion = Callable[[Context, Parameter, str], list[CompletionItem]]


def problems() -> list[str]:
    """Names of models, and of the problems of textbooks."""
    return [*model_names(), *sorted(public("mbdae.textbook.problems"))]


def methods() -> list[str]:
    """Names of all methods, those of installed packages too; scipy's are left out."""
    found = instances("mbdae.methods", "Tableau", "RadauIIA", "ExplicitMethod")
    return sorted({*found, *(point.name for point in entry_points_of("mbdae.methods"))})


def completed(names: Callable[[], Iterable[str]], *, files: bool = True) -> Completion:
    """Return what completes a word to a name, in a list with commas or behind a formulation too.

    Args:
        names: which there are.
        files: the word may also be the path of a file.
    """

    def complete(context: Context, parameter: Parameter, word: str) -> list[CompletionItem]:
        begun = word[: 1 + max(word.rfind(","), word.rfind(":"))]
        items = [CompletionItem(begun + name) for name in names() if name.startswith(word[len(begun) :])]
        return [CompletionItem(word, type="file")] * files + items  # bash forgets what stands before files

    return complete
