"""What the paper prints: the numbers of section 5 beside which a reproduction stands, and the places that are unclear.

`J_E_PRINTED` of NLS, 118.4, is a misprint: 381.0 - 272.6 = 108.4, which is the 12 % of the text. 405.1 and 381.0 are
printed as a11', but 405.1 - 302.2 = 102.9 takes them for J1 + J_e (see docs/paper.md).
"""

from __future__ import annotations

from dataclasses import dataclass

J1 = {"proposed": 302.2e-5, "nls": 272.6e-5}
"""J1^ without the body, kg m^2."""

A11_BODY = {"proposed": 405.1e-5, "nls": 381.0e-5}
"""Printed as a11'^, with the body, kg m^2."""

J_E_PRINTED = {"proposed": 102.9e-5, "nls": 118.4e-5}
"""Printed as J_e^, kg m^2 (the paper leaves out the 10^-5)."""

J_E = 96.1e-5
"""Known inertia of the test body about O, kg m^2."""

J_E_ERROR = {"proposed": 7.0, "nls": 12.0}
"""Errors of J_e^ in the text, per cent."""

F1 = 26e-5
"""f1 of the simulation, N m s; the bearing has f1 / i, 4.4 times that."""

SIMULATION_ERROR = 1.4
"""Average error of J1^ in the ideal simulation of Fig. 7, per cent."""

TIMES = (9.023, 9.413, 9.433, 9.823)
"""t10, t11, t20, t21 of the ideal simulation, s."""

SERIES = (15.0, 22.0)
"""Part of the experiment in which the intervals lie "in series", s."""

BACKSTEPPING = (5.0, 8.0)
"""Fig. 8: within so many per cent after so many seconds."""

FIG8 = 2.0
"""Frequency of the run that looks like Fig. 8, which the paper does not print (inferred), rad/s."""

AMPLITUDE, FREQUENCIES = 0.8, {"plain": 8.5, "body": 6.0, "balanced": 2.0}
"""Program motions y_m1, y_m2, y_m3: 0.8 rad, and rad/s."""


@dataclass(frozen=True)
class Unclear:
    """A place in the paper, what is printed there, what is done here, and the tests (file::name) that show why."""

    where: str
    printed: str
    here: str
    tests: tuple[str, ...]


UNCLEAR = (
    Unclear(
        "(6)",
        "ends in − m2 l2²",
        "left out: J1 as defined contains it, so that it would count twice",
        ("tests/test_paper_misprints.py::test_6_counts_m2_l2_squared_twice",),
    ),
    Unclear(
        "(6), (7)",
        "not said about what the passes are mirrored",
        "about the measured turning points; about those of the reference, which the controller lags, (6) is worse",
        ("tests/test_reproduce.py::test_the_mirror_about_the_reference_costs_what_the_controller_lags",),
    ),
    Unclear(
        "(3), (6)",
        "Π11 = Π22, Π12 = Π21, hence 4b (cos q12 − cos q11)",
        "2b (cos q12 − cos q11 + cos q13 − cos q14); the same at equal angles, which the paper's four times "
        "do not meet",
        ("tests/test_reproduce.py::test_6_letter_by_letter_errs_where_the_angles_of_the_nodes_differ",),
    ),
    Unclear(
        "(7)",
        "holds with B1 = B2",
        "holds only where the node speeds match besides",
        ("tests/test_energy.py::test_printed_formulas_are_exact_where_both_passes_lose_the_same",),
    ),
    Unclear(
        "works A, D",
        "integrals of sampled signals",
        "the voltage is held between samples; a trapezoid is half a sample late",
        ("tests/test_energy_twin.py::test_the_paper_s_simulation_by_the_trapezoid",),
    ),
    Unclear(
        "(8), third branch",
        "η M2 + d2 with d2 < 0",
        "η M2 − d2; as printed the torque jumps at the edge",
        ("tests/test_paper_misprints.py::test_8_jumps_in_its_third_branch_as_printed",),
    ),
    Unclear(
        "(9), first row",
        "−a22 (b sin q1 − M1d)",
        "+ M1d; the second row and (10) are right",
        ("tests/test_paper_misprints.py::test_9_has_the_sign_of_friction_wrong_in_its_first_row_only",),
    ),
    Unclear(
        "u1",
        "neutralises Coulomb friction in the bearing O",
        "it acts on motor and gearbox and cancels f3",
        ("tests/test_paper_misprints.py::test_u1_acts_on_the_motor_and_not_on_the_bearing",),
    ),
    Unclear(
        "(12)",
        "switches on the sign of u1 + u2",
        "exact is the sign of c1 (u1 + u2) − c2 q2'; both are offered",
        ("tests/test_compensator.py::test_printed_dead_zone_switch_errs_there",),
    ),
    Unclear(
        "(13)",
        "r(p) Hurwitz, r_m > 0; h monic of degree n",
        "α4 α9 = α5 α7, so r(p) = −α4 p: root 0, shared with a(p), r_m < 0. h has degree 1 and leads with −α2",
        ("tests/test_model_equations.py::test_the_wheels_speed_is_not_held",),
    ),
    Unclear(
        "(15)",
        "a(p) + ν r(p) α(p) Hurwitz",
        "cannot be met: the root 0 stays for every ν. A constant load spins the wheel up until the voltage is"
        " at its limit",
        ("tests/test_paper_misprints.py::test_a_constant_load_spins_the_wheel_up_until_the_voltage_is_at_its_limit",),
    ),
    Unclear(
        "(15), (20)",
        "k̃ α(p) ξ1 and α(p)(k̃ ξ1)",
        "they differ by k̃' ξ1; both are offered",
        ("tests/test_compensator.py::test_rho_2_is_equation_20_while_the_gain_grows",),
    ),
    Unclear(
        "(16), (19)",
        "σ > ν + κ",
        "with σ = σ0 k̃² that needs k̃ > 1/σ0, which is not so at the start",
        ("tests/test_paper_misprints.py::test_sigma_is_below_k_tilde_while_k_tilde_is_below_1_over_sigma0",),
    ),
    Unclear(
        "(16), (19)",
        "σ in thousands per second",
        "explicit Euler would be unstable; the chain is moved on exactly over a sample",
        ("tests/test_compensator.py::test_stable_at_any_rate",),
    ),
    Unclear(
        "(18)",
        "e(t) W_f(p)",
        "W_f(p) e(t)",
        ("tests/test_compensator.py::test_error_filter_and_adaptation_follow_18",),
    ),
    Unclear(
        "4.2, e1",
        '"the tracking error (14)"',
        "e1 = x1 − y_m, its opposite, as its derivatives and (21) say",
        ("tests/test_paper_misprints.py::test_e1_of_4_2_with_the_sign_of_14_would_drive_the_pendulum_away",),
    ),
    Unclear(
        "4.2, law of α̂2",
        "−γ2 e2 sin x1",
        "the proof leaves out the errors of α̂4 and α̂7, which follow α̂2: V2' may be positive. γ2 e2 (−sin "
        "x1 + c7 x4 − c4 u2) lets V2 fall; both are offered",
        ("tests/test_paper_misprints.py::test_v2_falls_with_the_consistent_law_and_may_rise_with_the_printed_one",),
    ),
    Unclear(
        "4.2, law of α̂2",
        "with the u2 of (21)",
        "under the limit of ± 10 V with the u2 that was applied, u0 − u1 − u3",
        ("tests/test_backstepping.py::test_one_sample_is_the_law_on_paper",),
    ),
    Unclear(
        "4.2, V2'",
        'hats and dots missing, "σ̂3" for the rate of α̂3',
        "both adaptation laws as written after (21)",
        ("tests/test_paper_misprints.py::test_v2_falls_with_the_consistent_law_and_may_rise_with_the_printed_one",),
    ),
    Unclear(
        "4.2, V2'",
        "negative definite, so globally asymptotically stable",
        "semidefinite in errors and estimates: tracking follows, the estimate (22) needs excitation besides",
        ("tests/test_backstepping.py::test_at_2_rad_per_s_the_consistent_law_is_far_slower",),
    ),
    Unclear(
        "(23)",
        "ε sign(x̂1), ε sign(x̂3)",
        "sign(x̃1), sign(x̃3)",
        ("tests/test_observer.py::test_the_sign_is_that_of_the_error_not_of_the_angle",),
    ),
    Unclear(
        "section 5, c2",
        "N m rad/s V⁻²",
        "N m s/rad; d1 and d2, which have no unit, are in N m; all on the rotor's shaft",
        ("tests/test_paper_misprints.py::test_c2_is_a_torque_per_speed",),
    ),
    Unclear(
        "section 5, b",
        "kg m³ s⁻²",
        "kg m² s⁻² = N m",
        ("tests/test_paper_misprints.py::test_b_of_section_5_is_a_torque",),
    ),
    Unclear(
        "section 5, Ĵe",
        "118.4 kg m² by NLS",
        "381.0 − 272.6 = 108.4, which is the 12 % of the text; 10⁻⁵ is missing",
        ("tests/test_paper_misprints.py::test_section_5_contradicts_itself_in_j_e",),
    ),
    Unclear(
        "section 5, Ĵe",
        "â11' − Ĵ1 − J2 − Jr",
        '"− J2 − Jr" was not applied to the numbers. If it were due, NLS would be the better one',
        ("tests/test_paper_misprints.py::test_the_ranking_of_section_5_rests_on_what_a11_prime_means",),
    ),
    Unclear(
        "section 5, W_f",
        "smooths the control signal before the work is computed",
        "takes 1/(1 + (ωT)²) of its amplitude, which (6) multiplies",
        ("tests/test_energy_observers.py::test_w_f_costs_what_the_motor_s_strength_does",),
    ),
    Unclear(
        "Fig. 7, times",
        "t10 to t21, no program motion",
        "symmetric about 9.423 s, next to 25.5 π/8.5: 0.8 sin 8.5t (inferred). The passes are longer than "
        "half a period, and the denominator of (6) is small",
        (
            "tests/test_paper_misprints.py::test_the_times_of_fig_7_miss_the_turning_point_and_reach_beyond_the_one_before",
        ),
    ),
    Unclear(
        "(6)",
        "–",
        "singular from turning point to turning point; refused",
        ("tests/test_energy.py::test_passes_from_turning_point_to_turning_point_are_refused",),
    ),
    Unclear(
        "Fig. 7, gains",
        "no sampling rate",
        "k̃ settles near 730 at 10 kHz, never at 1 kHz",
        (
            "tests/test_paper_gains.py::test_simulation_gains_settle_near_730_at_10_khz",
            "tests/test_paper_gains.py::test_simulation_gains_never_settle_at_1_khz",
        ),
    ),
    Unclear(
        "Fig. 8",
        "neither motion nor rate",
        "0.8 sin 2t at 10 kHz with ideal angles looks like it",
        ("tests/test_backstepping.py::test_the_paper_s_simulation_converges_to_5_per_cent_in_8_s_by_the_printed_law",),
    ),
)
