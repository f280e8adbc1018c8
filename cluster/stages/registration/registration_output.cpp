#include "cluster/stages/registration/registration_output.h"

#include <fmt/core.h>

#include <cmath>

#include "geometry/numbers/angles.h"
#include "io/project/inputs/pose_csv.h"
#include "io/store/units/block_file.h"
#include "io/text/csv_row.h"

namespace megablock {

namespace {

std::string registrations_csv(const Block& block, const std::vector<RegisteredPlace>& rows,
                              const RegisteredTrajectory& registered) {
  std::string text =
      "a,b,c,d,accepted,holds,weight,residual_sigmas,tracks,measurements,kept,median_before_px,median_after_px,"
      "position_sigma_m,rotation_sigma_deg,shift_m,reason\n";
  const auto name = [&](FrameIndex frame) { return csv_field(block.frames[frame].name); };
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const Place& p = rows[i].place;
    const PairRegistration& r = rows[i].registration;
    text +=
        fmt::format("{},{},{},{},{:d},{:d},{:.4f},{:.3f},{},{},{},{:.3f},{:.3f},{:.5f},{:.5f},{:.3f},{}\n", name(p.a),
                    name(p.b), name(p.c), name(p.d), r.accepted, registered.weight[i] >= kHolds, registered.weight[i],
                    registered.residual[i], r.tracks, r.measurements, r.kept, r.median_before_px, r.median_after_px,
                    r.position_sigma_m, r.rotation_sigma_deg, r.shift_m, csv_field(r.reason));
  }
  return text;
}

PoseTable pose_table(const Block& block, const std::vector<Pose>& poses) {
  PoseTable table;
  table.ground = block.ground;
  table.poses = poses;
  for (const Frame& frame : block.frames) {
    table.names.push_back(frame.name);
    table.passes.push_back(frame.pass);
  }
  return table;
}

}  // namespace

Block registered_block(const Block& block, const RegisteredTrajectory& registered, const JointOptions& joint) {
  const double neighbours = joint.position_neighbours;
  Block result = block;
  for (std::size_t f = 0; f < registered.frames.size(); ++f) {
    Frame& frame = result.frames[FrameIndex(static_cast<std::int64_t>(f))];
    frame.given_pose = registered.frames[f];
    const double weight = registered.position_weight[f];
    if (weight < kHolds)
      frame.position_prior.reset();
    else if (frame.position_prior)
      frame.position_prior->sigma.setConstant(joint.position_sigma_m * std::sqrt(neighbours / weight));
    if (frame.attitude_prior)
      frame.attitude_prior->sigma_rad.setConstant(kDegree * joint.attitude_sigma_deg * std::sqrt(neighbours));
  }
  return result;
}

void write_registration_outputs(const Job& job, const std::vector<Pose>& start,
                                const std::vector<RegisteredPlace>& rows, const RegisteredTrajectory& registered,
                                const JointOptions& joint, const std::string& tie_points) {
  write_pose_csv(job.store.path("register/start.csv"), pose_table(job.block, start));
  write_pose_csv(job.store.path("register/poses.csv"), pose_table(job.block, registered.frames));
  job.store.write_text("register/registrations.csv", registrations_csv(job.block, rows, registered));
  const Block block = registered_block(job.block, registered, joint);
  job.store.write("register/block.h5", job.store.seal("register/trajectory.h5")->content_hash,
                  [&](const std::string& path) { write_block(path, block); });
  std::string yaml = "# The block with its registered trajectory and estimated rig.\nblock: block.h5\n";
  if (!tie_points.empty()) yaml += "tie_points: " + tie_points + "\n";
  job.store.write_text("register/block.yaml", yaml);
}

}  // namespace megablock
