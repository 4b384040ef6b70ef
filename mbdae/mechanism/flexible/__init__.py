"""Flexible bodies: a floating frame and modal coordinates, u(r, q) = r + Phi(r) q in the axes of the frame.

A flexible body is a leaf of the tree. `attach_flexible` adds to a Pinocchio model

* the joint of its frame, which carries the rigid body (m, s0, I0): Pinocchio computes its terms; if the frame is
  fixed to its parent, no joint is added, and the rigid body is added to the parent body;
* below it a chain of k massless prismatic joints, one per mode: Pinocchio knows q, v, names and manifold. Their motions
  have no physical meaning; as ancestors of each other and descendants of the frame they have the sparsity of M;
* a frame for each node, on the last of these joints.

Two additions make the body flexible, in Python (`workspace`) and in the core (`native/mechanism/flexible_body.hpp`):

* M and nle get the terms of the modes, which Pinocchio does not compute: polynomials of degree 2 in q (`modal_body`);
* each node is an entry of `data.oMi`, `data.v`, `data.a`, after the joints, with columns of J for its modes. An
  `Anchor` on a node refers to this entry as its joint, so closures, forces and contacts need no special cases.

The elastic force -K q - D q' is a linear force law. `mbdae.mechanism.tree.tree_terms` calls Pinocchio and then these
additions; code that calls Pinocchio elsewhere rejects flexible bodies by name (`require_rigid`).

Source: A. A. Shabana, Dynamics of Multibody Systems, chapter 5; R. Schwertassek, O. Wallrapp, Dynamik flexibler
Mehrkoerpersysteme (1999).
"""

from .attach_flexible import FlexibleBody as FlexibleBody
from .attach_flexible import attach_flexible as attach_flexible
from .attach_flexible import require_leaves as require_leaves
from .beam import beam as beam
from .modal_body import ModalBody as ModalBody
