"""Commands whose options are made when they are needed: each process calls one command, and lists all of them."""

from collections.abc import Callable
from typing import Any

import click


class LateCommand(click.Command):
    """A command that gets its options when it is called, or when its help or a completion needs them.

    Args:
        add_options: returns the callback with the options of the command, like decorators of click.
        settings: as for `click.Command`.
    """

    def __init__(self, *, add_options: Callable[[Any], Any], callback: Callable[..., Any], **settings: Any) -> None:
        super().__init__(**settings)
        del self.params, self.callback  # `__getattr__` makes them
        self._make = lambda: click.command(add_options(callback))

    def __getattr__(self, name: str) -> Any:
        if name not in ("params", "callback"):
            raise AttributeError(f"{type(self).__name__!r} object has no attribute {name!r}", name=name, obj=self)
        made = self._make()
        self.params, self.callback = made.params, made.callback
        return vars(self)[name]
