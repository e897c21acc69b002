# For find_package(axlewire): the target axlewire::axlewire.
if(NOT TARGET axlewire::axlewire)
  get_filename_component(axlewire_prefix "${CMAKE_CURRENT_LIST_DIR}/../../.." ABSOLUTE)
  add_library(axlewire::axlewire STATIC IMPORTED GLOBAL)
  set_target_properties(axlewire::axlewire PROPERTIES
    IMPORTED_LOCATION "${axlewire_prefix}/lib/libaxlewire.a"
    INTERFACE_INCLUDE_DIRECTORIES "${axlewire_prefix}/include"
    INTERFACE_LINK_LIBRARIES "pthread;dl;m")
endif()
