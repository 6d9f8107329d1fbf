#pragma once

namespace understory {

// The map of points with surfaces that ICP and GICP match to.
struct IcpMapConfig {
  // One point per cube of this edge: the mean of all that fell into it.
  double cube_m = 0.25;
  // Above 0: instead of that, a point enters as it is if it is farther than this from all others,
  // P3 section 3.3; at most cube_m. Cubes only help to find it then, and share a surface.
  double epsilon_m = 0.0;
  // A cube counts as changed once its points have grown by this share; 0: always. Then its mean is
  // taken anew; with epsilon_m the surfaces around it are.
  double growth = 0.5;
  // The surfaces around a point are worked out again once its mean has moved by this; 0: always.
  double moved_m = 0.01;
  bool planes = true;          // the surface around each point; false: points alone
  double max_planarity = 0.1;  // see IcpConfig
  bool covariances = false;    // the covariance around each point, too
};

}  // namespace understory
