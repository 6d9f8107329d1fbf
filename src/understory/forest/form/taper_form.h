#pragma once

#include <string>

namespace understory {

// Species for which a national taper curve is known.
enum class TaperSpecies { kUnknown, kPine, kSpruce, kBirch };
// "unknown", "pine", "spruce", "birch".
[[nodiscard]] std::string taper_species_name(TaperSpecies species);

// The form of a stem: its diameter at a height, relative to another height. Pine, spruce and birch
// have the curves of Finland over bark (J. Laasasenaho, Taper curve and volume functions for pine,
// spruce and birch, Communicationes Instituti Forestalis Fenniae 108, 1982). A stem of unknown
// species has a power of the distance from the top.
class TaperForm {
 public:
  // `height_m` over 1.3. `power` is that of an unknown species.
  TaperForm(TaperSpecies species, double height_m, double power);

  // A number in proportion to the diameter at a height above the ground; 0 at the top and above.
  [[nodiscard]] double at(double height_m) const;

 private:
  TaperSpecies species_;
  double top_m_;
  double power_;
};

}  // namespace understory
