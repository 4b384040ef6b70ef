"""Discrete modes: which rows are active, and the switches between them.

A mechanism has *switches* (`switch.Switch`), each in one of a few states; the tuple of all states, integers, is a
*mode*. `Index2System.enter(mode)` deactivates the rows that no switch requires, in Python and in the core: their g, G
and Gdot v are 0, so they are never selected and their minimum-norm multipliers are 0; array shapes never change. State
0 is idle: no row, no force; analyses other than runs use the idle mode.

Each kind of switch is a class in a file of `kinds`, found by discovery. It defines

* ``from_mechanism(mechanism)``: the switches of a mechanism, each with its rows;
* ``active_rows(state)``: the active rows;
* ``guards(state)``: guard functions, positive during the state; their zeros are located by shorter steps;
* ``impact_rows(point, state, tolerance)``: the rows that take part in an impact, and their law (`impact_law`);
* ``candidate_rows(point, state, tolerance)``: the rows that may become active after an event, and bounds of their
  multipliers (`box_lcp`, Gauss's principle);
* ``next_state(...)``: the state that follows from the selected multipliers and accelerations.

The loop over steps, guards and transitions is `mbdae.integrate.events.mode_changes`. A switch whose state sets a force
(kinetic friction) does so in ``enter(system, state)``.

Source: Brogliato, Nonsmooth Mechanics, 3rd ed. (2016), chapters 4 to 6; Acary, Brogliato (2008), section 3.6.
"""
