"""What to look at in each figure and table, and where the paper's text errs."""

from __future__ import annotations

__all__ = ["CAPTIONS"]

CAPTIONS = {
    "fig7": "RMSE against speed on the training log, with the spread over blocks of time: the "
    "compliance wins at rest, the observer from some mrad/s on, and the optimum of q̇_trans lies "
    "where the curves cross. The printed α = 500 s/rad with q̇_trans = 0.001 rad/s leaves "
    "λ(0) = 0.378 of (20): at rest 38 % of m1 is an observer that is blind there.",
    "fig8": "20 s of the day of validation, shaded to the height of λ(q̇). No motion: the torsion "
    "follows the torque while the joint stands. The motor torque is not zero but ripple and an "
    "offset: with τ_m ≈ 0 the wave generator's term (16) is all but silent. What counts as "
    "motion is not printed; here |q̇| ≥ 0.01 rad/s.",
    "fig9": "At rest the observer o stays near zero whatever the push, in motion the compliance c1 "
    "is off by what the joint's vibration and the encoders make of it; m1 and m2 take the better "
    "one. All torques are positive outward: as printed (8) and (18) have opposite signs for one "
    "push, and (19) would average a torque with its negative.",
    "table1_compared": "Table I as a picture: grey is printed, points are rigs that differ in what "
    "the paper does not print. Look at the order of the methods within a panel, not at the "
    "lengths of the bars.",
    "table1": "RMSE [Nm], error variance [Nm²] and bias [Nm], validation on another day than the "
    "training. Most of m2's 49 % below o is c2's: as printed, c2 alone is 40 % below o, and m2 is "
    "15 % below c2. The printed RMSE² − variance leaves 0.9 to 1.1 Nm of bias in sd. kalman, co, "
    "mco and o2 are not in the paper: the filter in place of (19), and observers that hold the "
    "compliant gear. gp has 500 rows of training in place of 22070; of sd only the reference is "
    "printed, ours is a reading.",
    "table2": "Published and fitted. The gain L_d is −8 in the text and 80 in the table, "
    "without a unit: (7) with L = −8 diverges, 80 1/s at 500 Hz is our reading. The three viscous "
    "coefficients are hard to tell apart at these speeds (in some rigs the fit knows combinations "
    "only, which then stand below), so judge the curve. Fitted "
    "levels hold Stribeck and load-dependent friction as well.",
    "table3": "Published and fitted. Appendix B calls it Table II, and (17) what is (15), (16), "
    "(18), (23); (15) writes c_c, K_c0 for c_m, K_m0; the unit of a stiffness is Nm/rad, not "
    "Nm·rad; (11) repeats θ_ci, with Δθ = θ_c Ñ − θ_w (13) and (14) follow. (18) has a pole at "
    "2.07 mrad (c1) and 1.22 mrad (c2) of mesh torsion, where ours is held and flagged. The "
    "measured K_m0 also holds hysteresis and what (16) takes off too much of lost motion, and its "
    "error is wide because one loop is little to learn from.",
}
