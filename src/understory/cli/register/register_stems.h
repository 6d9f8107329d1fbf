#pragma once

#include <string>

#include "understory/cli/command.h"
#include "understory/geometry/points.h"
#include "understory/geometry/pose.h"
#include "understory/registration/stems/go_icp.h"
#include "understory/registration/stems/sparse_icp.h"

namespace understory {

// Two clouds of stems for `understory register`, as they are: at most some thousand points, z up.
struct StemClouds {
  std::string target_file;
  std::string source_file;
  Points target;
  Points source;
  Pose guess;             // target from source
  Pose file_from_target;  // to the frame of the target's file
  bool json = false;
};

// Both print the motion with its figures and return the exit code: untrusted where the match cannot
// be trusted. Throw InputError for clouds that are not sparse.
[[nodiscard]] int register_by_go_icp(const StemClouds& clouds, const GoIcpConfig& config,
                                     CommandContext& context);
[[nodiscard]] int register_by_stem_icp(const StemClouds& clouds, const SparseIcpConfig& config,
                                       CommandContext& context);

}  // namespace understory
