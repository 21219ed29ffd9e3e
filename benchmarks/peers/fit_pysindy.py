"""PySINDy: the weak form (WeakPDELibrary with time alone) of q1'' = (a22 (-b sin q1 - F) - a12 torque) / determinant.

Its state is q1', which the user has to differentiate from the readings, here by the package's own smoothed
differences. Features: the known load -a22 b sin q1 - a12 torque, whose coefficient is 1 / determinant and so tells J1;
q1' and its sign. No search for a sparse law is needed, as the law is known: the threshold is 0.
"""

from __future__ import annotations

import warnings

import numpy as np
from problem import Log

NAME, PACKAGES = "PySINDy, weak form", ("pysindy",)
LOAD = 1e-6
"""Size of the load, kg m^2 N m."""


def fit(log: Log) -> float:
    import pysindy as ps

    m, time, angles = log.motor, log.time, log.angles
    smoothed = ps.SmoothedFiniteDifference(smoother_kws={"window_length": 21, "polyorder": 3})
    speeds = np.asarray(smoothed._differentiate(angles, time))
    a12, a22 = m.J2 + m.gear * m.Jr, m.J2 + m.gear**2 * m.Jr
    torque = m.eta * (m.c1 * log.voltage - m.c2 * speeds[:, 1])
    live = np.maximum(torque - m.d1, 0.0) + np.minimum(torque - m.d2, 0.0)
    wheel = m.gear * (live - m.f2 * m.gear * speeds[:, 1] - m.f3 * np.sign(speeds[:, 1]))
    load = (-a22 * m.b * np.sin(angles[:, 0]) - a12 * wheel) / LOAD
    functions = ps.CustomLibrary(library_functions=[lambda x: x], interaction_only=True)
    library = ps.WeakPDELibrary(
        function_library=functions, spatiotemporal_grid=time, K=200, H_xt=[0.37], p=4, include_bias=False
    )
    model = ps.SINDy(optimizer=ps.STLSQ(threshold=0.0, alpha=0.0, normalize_columns=True), feature_library=library)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        np.random.seed(0)  # noqa: NPY002 - the package draws where its subdomains lie from there
        model.fit(speeds[:, :1], t=time, u=np.column_stack([load, np.sign(speeds[:, 0])]))
    names, values = model.get_feature_names(), model.coefficients()[0]
    coefficient = dict(zip(names, values, strict=True))["f0(u0)"] / LOAD
    return float((1.0 / coefficient + a12**2) / a22 - m.J2 - m.Jr)
