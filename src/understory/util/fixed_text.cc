#include "understory/util/fixed_text.h"

#include <fmt/format.h>

namespace understory {
namespace {

std::string without_sign_of_zero(std::string text) {
  if (text.find_first_not_of("+-0.") == std::string::npos && text.find_first_of("+-") == 0)
    text.erase(0, 1);
  return text;
}

}  // namespace

std::string fixed_text(double value, int decimals) {
  return without_sign_of_zero(fmt::format("{:.{}f}", value, decimals));
}

std::string signed_text(double value, int decimals) {
  return without_sign_of_zero(fmt::format("{:+.{}f}", value, decimals));
}

}  // namespace understory
