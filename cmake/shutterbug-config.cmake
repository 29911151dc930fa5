# find_package(shutterbug) -> shutterbug::shutterbug (shared) and shutterbug::static. Found from its own place, so that an
# installed folder can be moved.
get_filename_component(_shutterbug_prefix "${CMAKE_CURRENT_LIST_DIR}/../../.." ABSOLUTE)
find_path(SHUTTERBUG_INCLUDE_DIR shutterbug.h PATHS "${_shutterbug_prefix}/include" NO_DEFAULT_PATH)
find_library(SHUTTERBUG_LIBRARY NAMES shutterbug PATHS "${_shutterbug_prefix}"
             PATH_SUFFIXES lib lib64 "lib/${CMAKE_LIBRARY_ARCHITECTURE}" NO_DEFAULT_PATH)
find_file(SHUTTERBUG_STATIC_LIBRARY libshutterbug.a PATHS "${_shutterbug_prefix}"
          PATH_SUFFIXES lib lib64 "lib/${CMAKE_LIBRARY_ARCHITECTURE}" NO_DEFAULT_PATH)

if(NOT SHUTTERBUG_INCLUDE_DIR OR NOT SHUTTERBUG_LIBRARY)
  set(shutterbug_FOUND FALSE)
  set(shutterbug_NOT_FOUND_MESSAGE "no header or library below ${_shutterbug_prefix}")
  return()
endif()

if(NOT TARGET shutterbug::shutterbug)
  add_library(shutterbug::shutterbug SHARED IMPORTED)
  set_target_properties(shutterbug::shutterbug PROPERTIES
    IMPORTED_LOCATION "${SHUTTERBUG_LIBRARY}"
    INTERFACE_INCLUDE_DIRECTORIES "${SHUTTERBUG_INCLUDE_DIR}")
endif()
if(SHUTTERBUG_STATIC_LIBRARY AND NOT TARGET shutterbug::static)
  add_library(shutterbug::static STATIC IMPORTED)
  set_target_properties(shutterbug::static PROPERTIES
    IMPORTED_LOCATION "${SHUTTERBUG_STATIC_LIBRARY}"
    INTERFACE_INCLUDE_DIRECTORIES "${SHUTTERBUG_INCLUDE_DIR}"
    INTERFACE_LINK_LIBRARIES "gcc_s;util;rt;pthread;m;dl")
endif()
