"""What [Hwangbo 2018] reports, measured there on one core of an Intel Xeon E5-1620 at 3.6 GHz."""

PROCESSOR = "Intel Xeon E5-1620, 3.6 GHz"

#: Table I: one solve [s].
SINGLE_CONTACT = {"bisection": 0.58e-6, "golden_section": 1.2e-6, "quartic": 1.6e-6}

#: Table II: 100,000 steps [s].
STEPS_100K = {
    "bisection": {"trot": 1.98, "hang": 2.57, "drop": 2.62, "random": 1.90},
    "pgs": {"trot": 1.81, "hang": 5.92, "drop": 4.35, "random": 2.88},
}

#: Fig. 6: "More than 99.6% of the time, the difference remained below 1%".
LAWS_BELOW_1_PERCENT = 0.996

#: Section VI: "the PGS took more than 20,000 iterations to solve the contact problem at the impact".
PGS_SWEEPS_AT_IMPACT = 20_000
