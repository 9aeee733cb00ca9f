/// Every physical effect, a line each.
#pragma once

#include <tuple>
#include <variant>

#include "flexspline/effects/backlash.hpp"
#include "flexspline/effects/cogging.hpp"
#include "flexspline/effects/coulomb_friction.hpp"
#include "flexspline/effects/coulomb_friction_per_direction.hpp"
#include "flexspline/effects/direction_dependent_friction.hpp"
#include "flexspline/effects/gain_error.hpp"
#include "flexspline/effects/gain_temperature_dependence.hpp"
#include "flexspline/effects/gravity.hpp"
#include "flexspline/effects/inertia.hpp"
#include "flexspline/effects/kinematic_error.hpp"
#include "flexspline/effects/load_dependent_friction.hpp"
#include "flexspline/effects/mesh_compliance.hpp"
#include "flexspline/effects/motor_crosstalk.hpp"
#include "flexspline/effects/nonlinear_viscous_friction.hpp"
#include "flexspline/effects/offset.hpp"
#include "flexspline/effects/output_ripple.hpp"
#include "flexspline/effects/position_dependent_friction.hpp"
#include "flexspline/effects/presliding_friction.hpp"
#include "flexspline/effects/sensor_lag.hpp"
#include "flexspline/effects/sensor_nonlinearity.hpp"
#include "flexspline/effects/speed_dependent_ripple.hpp"
#include "flexspline/effects/stribeck_friction.hpp"
#include "flexspline/effects/temperature_dependent_friction.hpp"
#include "flexspline/effects/temperature_dependent_stiffness.hpp"
#include "flexspline/effects/temperature_drift.hpp"
#include "flexspline/effects/thermal_gradient_drift.hpp"
#include "flexspline/effects/time_drift.hpp"
#include "flexspline/effects/torque_constant_error.hpp"
#include "flexspline/effects/torque_hysteresis.hpp"
#include "flexspline/effects/torsional_hysteresis.hpp"
#include "flexspline/effects/viscous_friction.hpp"
#include "flexspline/effects/wave_generator_compliance.hpp"
#include "flexspline/effects/wave_generator_ripple.hpp"

namespace flexspline {

/// `Combine<Effects...>` with all effects; ripple effects with room for K harmonics.
template <template <typename...> typename Combine, typename S, std::size_t K>
using Catalogue = Combine<            //
    Offset<S>,                        //
    CoulombFriction<S>,               //
    CoulombFrictionPerDirection<S>,   //
    ViscousFriction<S>,               //
    DirectionDependentFriction<S>,    //
    NonlinearViscousFriction<S>,      //
    StribeckFriction<S>,              //
    PreslidingFriction<S>,            //
    LoadDependentFriction<S>,         //
    TemperatureDependentFriction<S>,  //
    PositionDependentFriction<S>,     //
    Inertia<S>,                       //
    Gravity<S>,                       //
    OutputRipple<S, K>,               //
    WaveGeneratorRipple<S, K>,        //
    SpeedDependentRipple<S, K>,       //
    Cogging<S, K>,                    //
    TemperatureDrift<S>,              //
    ThermalGradientDrift<S>,          //
    TimeDrift<S>,                     //
    GainError<S>,                     //
    GainTemperatureDependence<S>,     //
    SensorNonlinearity<S>,            //
    TorqueHysteresis<S>,              //
    MotorCrosstalk<S>,                //
    SensorLag<S>,                     //
    TorqueConstantError<S>,           //
    MeshCompliance<S>,                //
    WaveGeneratorCompliance<S>,       //
    KinematicError<S, K>,             //
    TorsionalHysteresis<S>,           //
    Backlash<S>,                      //
    TemperatureDependentStiffness<S>>;

/// Refuses to compile, with its type, an effect that does not keep the contract.
template <typename S>
struct Contract {
  template <typename Effect>
  struct Kept : std::true_type {
    static_assert(PhysicalEffect<Effect, S>);
  };
  template <typename... Effects>
  using ByAll = std::bool_constant<(Kept<Effects>::value && ...)>;
};
static_assert(Catalogue<Contract<float>::ByAll, float, 2>::value);
static_assert(Catalogue<Contract<double>::ByAll, double, 2>::value);

}  // namespace flexspline
