/// Every physical effect, a line each.
#pragma once

#include <tuple>
#include <variant>

#include "flexspline/effects/cogging.hpp"
#include "flexspline/effects/coulomb_friction.hpp"
#include "flexspline/effects/coulomb_friction_per_direction.hpp"
#include "flexspline/effects/gain_error.hpp"
#include "flexspline/effects/gravity.hpp"
#include "flexspline/effects/inertia.hpp"
#include "flexspline/effects/kinematic_error.hpp"
#include "flexspline/effects/load_dependent_friction.hpp"
#include "flexspline/effects/mesh_compliance.hpp"
#include "flexspline/effects/nonlinear_viscous_friction.hpp"
#include "flexspline/effects/offset.hpp"
#include "flexspline/effects/output_ripple.hpp"
#include "flexspline/effects/stribeck_friction.hpp"
#include "flexspline/effects/temperature_drift.hpp"
#include "flexspline/effects/torsional_hysteresis.hpp"
#include "flexspline/effects/viscous_friction.hpp"
#include "flexspline/effects/wave_generator_compliance.hpp"
#include "flexspline/effects/wave_generator_ripple.hpp"

namespace flexspline {

/// `Combine<Effects...>` with all effects; ripple effects with room for K harmonics.
template <template <typename...> typename Combine, typename S, std::size_t K>
using Catalogue = Combine<           //
    Offset<S>,                       //
    CoulombFriction<S>,              //
    CoulombFrictionPerDirection<S>,  //
    ViscousFriction<S>,              //
    NonlinearViscousFriction<S>,     //
    StribeckFriction<S>,             //
    LoadDependentFriction<S>,        //
    Inertia<S>,                      //
    Gravity<S>,                      //
    OutputRipple<S, K>,              //
    WaveGeneratorRipple<S, K>,       //
    Cogging<S, K>,                   //
    TemperatureDrift<S>,             //
    GainError<S>,                    //
    MeshCompliance<S>,               //
    WaveGeneratorCompliance<S>,      //
    KinematicError<S, K>,            //
    TorsionalHysteresis<S>>;

}  // namespace flexspline
