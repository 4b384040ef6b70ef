"""Every kind of Runge-Kutta method for index-2 problems."""

from .implicit_tableau import ImplicitTableau
from .radau import RadauIIA
from .tableau import Tableau

RungeKutta = Tableau | RadauIIA | ImplicitTableau
