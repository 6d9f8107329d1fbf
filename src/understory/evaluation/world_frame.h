#pragma once

#include <Eigen/Core>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

namespace understory {

// The axes in which the text files of a run tell world coordinates (`output.world_frame`). Within
// the program they are always east, north, up (z up against gravity). Only files are turned, when a
// run is written, and turned back, when one is read. Axes of the body stay as they are.
enum class WorldFrame { kEnu, kNed };

// A place or direction of the world in the other axes: (y, x, -z). The same turn, half a turn about
// the line between x and y, leads there and back.
[[nodiscard]] Eigen::Vector3d turned_axes(const Eigen::Vector3d& in_world);

// Names of the files of a run that hold world coordinates as text, and that are turned. They are
// trajectories, states, graph, fixes, trees, stem curves, falls, cuts and plots.
[[nodiscard]] const std::vector<std::string>& world_files();
// What `frames` of run.json says of them: "world" or "world_ned".
[[nodiscard]] std::string frame_name(WorldFrame frame);

// Turns all of them in `folder`, which hold east, north, up, to north, east, down. Positions,
// velocities and residuals keep their digits. Attitudes get twelve decimals, so that a reader gets
// the nine of before. Throws InputError or OutputError.
void turn_to_ned(const std::filesystem::path& folder);

// The axes of a file of a run: what run.json beside it says. East, north, up where there is no
// run.json, or where it does not name the file. Throws InputError where run.json is damaged and a
// part of it tells of north, east, down: then the axes are not known.
[[nodiscard]] WorldFrame world_frame_of(const std::filesystem::path& file);
// The same of a run folder, by its trajectory.tum.
[[nodiscard]] WorldFrame world_frame_of_run(const std::filesystem::path& folder);

// For a reader of a file of a run (LineReader, CsvFormat::edit): turns its lines back to east,
// north, up. Empty where they are so already. Lines that are not understood stay as they are, and
// the reader says what is wrong with them. Throws as `world_frame_of`.
[[nodiscard]] std::function<void(std::string&)> turned_back(const std::filesystem::path& file);

}  // namespace understory
