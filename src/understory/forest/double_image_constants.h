#pragma once

#include <cstddef>

// Numbers of forest/trees/double_images.cc that are no settings. What the words in brackets mean:
// stem_constants.h.
namespace understory::double_image_constants {
// m between the axes of two images of one tree; trees stand farther apart in most stands [bound:
// spacing]
inline constexpr double kMostApart = 0.6;
// Share of their mean radius by which the radii of two images differ at most ... [chosen]
inline constexpr double kAlikeShare = 0.15;
// ... or standard deviations of the difference [chosen]
inline constexpr double kAlikeSds = 2.0;
// Share of the distance of a pair within which a third stem goes on in a row [chosen]
inline constexpr double kRowShare = 0.3;
// m around a pair, or a stem, in which others are asked: drift changes along the path [chosen]
inline constexpr double kReach = 20.0;
// Others that are asked at most, the nearest [chosen]
inline constexpr std::size_t kMostNear = 12;
// m by which two vectors differ at most that agree ... [tuned on clouds made by hand]
inline constexpr double kAgree = 0.04;
// ... or as a share of their length [tuned on clouds made by hand]
inline constexpr double kAgreeShare = 0.25;
// Pairs that have to agree with one, beside being most of those that are asked [chosen]
inline constexpr std::size_t kFewestAgreeing = 4;
// Stems seen all round that a mean outline needs [bound: statistics]
inline constexpr std::size_t kFewestRound = 8;
// Amplitude of an outline's second harmonic over the distance of two half circles: 2 / (3 pi)
// [bound: geometry]
inline constexpr double kOvalPerApart = 0.2122;
// Standard deviations of the mean outline from a round one [chosen]
inline constexpr double kClearSds = 4.0;
// m between two scans that an outline shows at least: stems are not quite round ... [chosen]
inline constexpr double kLeastOval = 0.02;
// ... nor are thick ones: share of their diameter [chosen]
inline constexpr double kGrownShare = 0.05;
// Trees of a list that stand twice, from which on the list is not to be trusted ... [chosen]
inline constexpr std::size_t kFewestTwice = 8;
// ... and their share [tuned on maps of random 2 and 6, half of whose time was moved by 10 cm: 4.5
// % and more; as they were, none stood twice]
inline constexpr double kTwiceShare = 0.04;
// Share of the stems seen all round whose outlines tell of two scans, for the same [chosen]
inline constexpr double kOvalShare = 0.3;
// m between the images of a whole cloud that was laid on itself wrongly, at most [chosen: an error
// of satellite fixes below trees]
inline constexpr double kFarApart = 3.0;
// Offsets that are tried, the fullest first [bound: time]
inline constexpr int kMostOffsets = 8;
// m by which such images differ at most from the offset of all [chosen: errors of two positions]
inline constexpr double kFarAgree = 0.15;
// Share of the trees that have an image at the offset, at least [chosen: half of a cloud may be
// seen once; tuned on random seeds, where the fullest offset has a tenth]
inline constexpr double kFarShare = 0.4;
// Differences of diameters within pairs over those of trees taken at random, both root mean
// squares, at most [chosen: half of what neighbours of like diameter have]
inline constexpr double kFarAlike = 0.2;
}  // namespace understory::double_image_constants
