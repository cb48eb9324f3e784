#pragma once

namespace texmesh {

/// A command, as the program's help lists it.
struct CommandSummary {
  const char *group, *name, *text;
};

/// Every command, in the help's order. The program that only prints help and version has nothing else of
/// them.
inline constexpr CommandSummary kCommands[] = {
    {"Make packages", "compile", "Compile textured scans into packages"},
    {"Make packages", "stages", "Print the graph of stages that compile runs"},
    {"Make packages", "cache", "Look at, prune or check the cache folder"},
    {"Make packages", "list", "List the models of a collection with their packages and files"},
    {"Make packages", "summary", "Merge the reports of many runs of compile into one"},
    {"Look inside", "view", "Look at packages in a browser: serves the packages and the viewer"},
    {"Look inside", "dump", "Show what a package holds and why it is as large as it is"},
    {"Look inside", "verify", "Check every byte of packages: digests, documents, meshes, images"},
    {"Look inside", "diff", "Say what differs between two packages, and why"},
    {"Look inside", "render", "Picture a model or a package as viewers show it, lit"},
    {"Look inside", "report", "Write a page that shows what viewers of a package see"},
    {"Look inside", "debug", "Picture what a stage computed, with a legend of its colours"},
    {"Look inside", "doctor", "Say what a model's texture atlas costs and what to do: a gate for CI, too"},
    {"Export", "extract", "Write one GLB that any viewer opens: a scale with whole textures"},
    {"Export", "export",
     "Write a package in the form of another viewer: 3D Tiles, MSFT_lod, model-viewer, oEmbed"},
    {"Export", "site", "Write a static site of a collection: posters, search, licences, a viewer"},
    {"Export", "unpack", "Write a package's entries as files, for servers or tools that want a folder"},
    {"Export", "pack", "Put an unpacked package together again, byte for byte"},
    {"Deliver over a network", "plan",
     "Say what a viewer will get in a time over a link, or in a number of bytes"},
    {"Deliver over a network", "check",
     "Fail when a package does not show well enough in a time: a gate for CI"},
    {"Deliver over a network", "fetch", "Fetch from web servers what a viewer would get within a time"},
    {"Deliver over a network", "simulate", "Play a transfer over a model of a network"},
};

}  // namespace texmesh
