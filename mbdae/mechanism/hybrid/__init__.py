"""Modes: which rows are there, and what switches them.

A mechanism has *switches* (`switch.Switch`), each in one of a few states; the states of all of them, a tuple of whole
numbers, are a *mode*. `Index2System.enter(mode)` leaves out the rows that no switch wants (their g, G and Gdot v are 0,
so nothing chooses them and their multipliers of least norm are 0), in Python and in the core; shapes never change.
State 0 is idle: no row, no force; what is asked of a mechanism outside a run is asked in the idle mode.

A kind of switch is a file here with a class, found by looking. It says

* ``of(mechanism)``: those that a mechanism has, each with its rows;
* ``active(state)``: the rows that are solved for;
* ``guards(state)``: what is watched: positive while the state lasts, located by shorter steps where it passes 0;
* ``strike(point, state)``: rows that take part in an impact, and with which law (`impact`);
* ``candidate(point, state, fired)``: rows that may carry load from here on, and the box for their multipliers
  (`choice`, Gauss's principle);
* ``settled(...)``: the state that follows from the multipliers and accelerations that were chosen.

The loop over steps, guards and transitions is `mbdae.integrate.mode_switching`. A switch whose state sets a force
(friction that slips) does so in ``enter(system, state)``.

Source: Brogliato, Nonsmooth Mechanics, 3rd ed. (2016), chapters 4 to 6; Acary, Brogliato (2008), section 3.6.
"""
