// The order of the parts is fixed: layout (cameras, mounts, poses), control points, tie points, priors. Each draws from
// streams of its own, so that an option of one part leaves the others as they are.
#include "io/simulate/blocks/simulate.h"

#include "io/base/error.h"
#include "io/simulate/blocks/aerial.h"
#include "io/simulate/blocks/control.h"
#include "io/simulate/blocks/panorama.h"
#include "io/simulate/blocks/priors.h"
#include "io/simulate/blocks/stereopolis.h"
#include "io/simulate/blocks/street.h"
#include "io/simulate/blocks/target_field.h"
#include "io/simulate/blocks/tie_points.h"
#include "io/simulate/scene/four_sides.h"
#include "io/simulate/scene/trajectory.h"

namespace megablock {

Layout make_layout(const SimulationOptions& options) {
  switch (options.scene) {
    case SimulationOptions::Scene::kAerial:
      return make_aerial_layout(options);
    case SimulationOptions::Scene::kStreet:
      return make_street_layout(options);
    case SimulationOptions::Scene::kStereopolis:
      return make_stereopolis_layout(options);
    case SimulationOptions::Scene::kPanorama:
      return make_panorama_layout(options);
    case SimulationOptions::Scene::kCourtyard:
      return make_courtyard_layout(options);
    case SimulationOptions::Scene::kTower:
      return make_tower_layout(options);
    case SimulationOptions::Scene::kTargetField:
      break;
  }
  return make_target_field_layout(options);
}

void simulate_given(const SimulationOptions& options, SimulatedBlock& simulated) {
  if (options.scene == SimulationOptions::Scene::kStereopolis)
    simulate_trajectory(options, simulated);
  else
    simulate_priors(options, simulated);
}

SimulatedBlock simulate_block(const SimulationOptions& options, const TrackSink& sink,
                              std::int64_t batch_observations) {
  options.check();
  Layout layout = make_layout(options);
  if (!layout.scene)
    throw InputError("simulation: courtyards and towers are made of rendered images only; add --rendered");
  // Without positions and control the job has nothing that ties it to the earth. A ground frame that claims this would
  // be wrong.
  layout.block.ground.georeferenced =
      options.gps_sigma_m > 0 || options.control_points > 0 || options.control_zones > 0;
  if (layout.block.ground.georeferenced) layout.block.ground = {true, 48.85, 2.35, 100, "EPSG:4326"};

  SimulatedBlock simulated;
  simulated.tracks.begin = {0};
  {
    const Observer observer(layout, image_margin(options));
    simulate_control_zones(options, observer, layout);
    simulate_control(options, observer, layout);
    simulate_tracks(options, layout, observer, sink, batch_observations);
  }
  simulated.block = std::move(layout.block);
  simulated.truth = std::move(layout.truth);
  simulated.control_truth = std::move(layout.control_truth);
  simulate_given(options, simulated);
  check(simulated.block);
  return simulated;
}

SimulatedBlock simulate_block(const SimulationOptions& options) {
  SimulatedTracks all;
  all.tracks.begin = {0};
  SimulatedBlock simulated =
      simulate_block(options, [&](const SimulatedTracks& batch) { append_tracks(all, batch, 0, batch.points.size()); });
  static_cast<SimulatedTracks&>(simulated) = std::move(all);
  return simulated;
}

}  // namespace megablock
