"""Tab completion of models, methods and formulations, without slow imports."""

from collections.abc import Callable, Iterable

from click import Context, Parameter
from click.shell_completion import CompletionItem

from ..discovery import entry_points_of, instance_names, model_names, public_names

FORMULATIONS = ("index2", "ggl", "index1")
COMPARED = ("index2", "project", "ggl")  # formulations of half-explicit methods in a comparison

Completion = Callable[[Context, Parameter, str], list[CompletionItem]]


def problems() -> list[str]:
    """Return names of models and textbook problems."""
    return [*model_names(), *sorted(public_names("mbdae.textbook.problems"))]


def methods() -> list[str]:
    """Return names of all methods, including those of installed packages, except solvers of other libraries."""
    names = instance_names(
        "mbdae.methods", "Tableau", "RadauIIA", "ImplicitTableau", "Composition", "alpha_method", "ExplicitMethod"
    )
    return sorted({*names, *(point.name for point in entry_points_of("mbdae.methods"))})


def completed(names: Callable[[], Iterable[str]], *, files: bool = True) -> Completion:
    """Return a completion of names, including names in a list with commas, or after a formulation and a colon.

    Args:
        names: the valid names.
        files: whether the word may also be the path of a file.
    """

    def complete(context: Context, parameter: Parameter, word: str) -> list[CompletionItem]:
        prefix = word[: 1 + max(word.rfind(","), word.rfind(":"))]
        items = [CompletionItem(prefix + name) for name in names() if name.startswith(word[len(prefix) :])]
        return [CompletionItem(word, type="file")] * files + items  # bash ignores entries before files

    return complete
