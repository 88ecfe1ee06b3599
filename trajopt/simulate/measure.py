"""What a session shows, in terms of the robot: wheels, loads, slip, obstacles touched."""

from __future__ import annotations

import numpy as np

from trajopt.arrays import Array
from trajopt.simulate.engine import Contacts, Motion, Observation, Session
from trajopt.simulate.model import cross
from trajopt.simulate.scene import Stage

NONE = np.zeros(0)
FACE = 0.7  # vertical part of the normal below which a contact with a step is one with its face


def observe(session: Session) -> Observation:
    """State now."""
    model, base, contacts = session.model, session.base(), session.contacts()
    angles, speeds, torques = session.joints(model.spins)
    feet = session.motion(model.feet)
    loads, over = _wheels(session, contacts, feet)
    return Observation(
        base.place[0],
        base.rotation[0],
        base.velocity[0],
        base.spin[0],
        angles,
        speeds,
        torques,
        feet.place[model.spin_feet],
        session.joints(model.targets)[0] if model.targets else NONE,
        session.joints(model.swivels)[0] if model.swivels else NONE,
        loads,
        np.sqrt(_dots(over, over)),
        (over @ base.rotation[0])[:, :2],
        _turned(session),
        session.joints(model.suspension)[0] if model.suspension else NONE,
        int(np.count_nonzero(contacts.solid < 0)),
        float(contacts.depth.max(initial=0.0)),
        _hits(session.stage, contacts) if len(contacts.link) else (),
    )


def _turned(session: Session) -> Array:
    """(A,): angles of all wheels that turn."""
    feet = session.model.feet
    turning = [i for i, foot in enumerate(feet) if session.model.links[foot].joint.role == "spin"]
    found = np.zeros(len(feet))
    found[turning] = session.joints(tuple(feet[i] for i in turning))[0]
    return found


def _wheels(session: Session, contacts: Contacts, feet: Motion) -> tuple[Array, Array]:
    """Load (A,) N of each wheel and its velocity (A, 3) m/s over the ground, at the contact that carries most, along
    the roller's axis where a roller touches."""
    model = session.model
    found = np.zeros((len(model.feet), 3))
    wheel = model.wheel_of[contacts.link]
    used = np.flatnonzero(wheel >= 0)
    if len(used) == 0:
        return found[:, 0].copy(), found
    wheel, links, force = wheel[used], contacts.link[used], contacts.force[used]
    place, normal = contacts.place[used], contacts.normal[used]
    arm = place - feet.place[wheel]
    over = _level(feet.velocity[wheel] + cross(feet.spin[wheel], arm), normal)
    rolling = np.flatnonzero(model.is_roller[links])
    if len(rolling):
        axis = session.motion(tuple(links[rolling].tolist())).rotation[:, :, 2]
        axis = _level(axis, normal[rolling])
        along = _dots(over[rolling], axis) / np.maximum(_dots(axis, axis), 1e-12)
        over[rolling] = along[:, None] * axis
    order = np.argsort(force)  # the last one written is that of the largest force
    found[wheel[order]] = over[order]
    loads: Array = np.bincount(wheel, force, minlength=len(found)).astype(np.float64)
    return loads, found


def _dots(a: Array, b: Array) -> Array:
    return np.asarray(np.einsum("ij,ij->i", a, b))


def _level(vectors: Array, normals: Array) -> Array:
    return vectors - _dots(vectors, normals)[:, None] * normals


def _hits(stage: Stage, contacts: Contacts) -> tuple[tuple[str, tuple[float, float]], ...]:
    """Obstacles that the outline meets, faces of steps that anything meets, and the ground where
    the chassis does."""
    found: dict[str, tuple[float, float]] = {}
    things = (contacts.solid >= 0) & (np.abs(contacts.normal[:, 2]) < FACE)
    for k in np.flatnonzero(things | (contacts.link == 0)):
        solid = contacts.solid[k]
        name = "ground" if solid < 0 else stage.solids[solid].name
        if name != "ground" or contacts.link[k] == 0:
            found.setdefault(name, (float(contacts.place[k, 0]), float(contacts.place[k, 1])))
    return tuple(found.items())
