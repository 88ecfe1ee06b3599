"""A function of one's own with an inequality and an equality (HS71), by several optimizers."""

import numpy as np

import trajopt


def cost(x):
    return x[0] * x[3] * (x[0] + x[1] + x[2]) + x[2]


constraints = [
    ("ineq", lambda x: np.prod(x) - 25),  # kept where >= 0
    ("eq", lambda x: np.dot(x, x) - 40),
]
for optimizer in ("slsqp", "trust-constr", "ipopt", "auto"):
    found = trajopt.minimize(
        cost,
        [[1, 5]] * 4,
        constraints=constraints,
        optimizer=optimizer,
        budget=trajopt.Budget(evaluations=4000),
    )
    print(f"{optimizer:12} {found.fun:.4f} violation {found.violation:.1e} {found.status.value}")
