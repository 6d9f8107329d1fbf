# What is installed beside the program, and the Debian package that CPack makes of it (./run package).
option(UNDERSTORY_PACKAGE "make the manual pages, and prepare CPack" OFF)

set(understory_doc "${CMAKE_INSTALL_DATADIR}/doc/understory")
install(DIRECTORY configs/ DESTINATION "${CMAKE_INSTALL_DATADIR}/understory/configs")
install(FILES packaging/copyright README.md CHANGELOG.md DESTINATION "${understory_doc}")
install(DIRECTORY docs/ DESTINATION "${understory_doc}/docs")

if(UNDERSTORY_PACKAGE)
  # A page for the program and one for each command, from their --help.
  set(understory_manual "${PROJECT_BINARY_DIR}/manual")
  add_custom_command(OUTPUT "${understory_manual}/understory.1.gz"
    COMMAND "${PROJECT_SOURCE_DIR}/tools/manual.sh" "$<TARGET_FILE:understory>" "${understory_manual}"
    DEPENDS understory "${PROJECT_SOURCE_DIR}/tools/manual.sh"
    COMMENT "Writing the manual pages" VERBATIM)
  add_custom_target(manual ALL DEPENDS "${understory_manual}/understory.1.gz")
  install(DIRECTORY "${understory_manual}/" DESTINATION "${CMAKE_INSTALL_MANDIR}/man1")

  # The name of the release is part of the version, so that a newer release's package replaces an older one's.
  file(STRINGS /etc/os-release understory_release REGEX "^VERSION_ID=")
  string(REGEX MATCH "[0-9.]+" understory_release "${understory_release}")
  set(CPACK_GENERATOR DEB)
  set(CPACK_PACKAGE_NAME understory)
  set(CPACK_PACKAGE_VERSION "${PROJECT_VERSION}")
  set(CPACK_PACKAGE_CONTACT "The Understory authors")
  set(CPACK_PACKAGING_INSTALL_PREFIX /usr)
  set(CPACK_STRIP_FILES ON)
  set(CPACK_INSTALL_DEFAULT_DIRECTORY_PERMISSIONS
      OWNER_READ OWNER_WRITE OWNER_EXECUTE GROUP_READ GROUP_EXECUTE WORLD_READ WORLD_EXECUTE)
  set(CPACK_DEBIAN_PACKAGE_VERSION "${PROJECT_VERSION}+deb${understory_release}")
  set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
  set(CPACK_DEBIAN_PACKAGE_SECTION science)
  set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS ON)
  # Coordinate systems come from its database, which no library names.
  set(CPACK_DEBIAN_PACKAGE_DEPENDS proj-data)
  set(CPACK_DEBIAN_COMPRESSION_TYPE xz)
  set(CPACK_DEBIAN_PACKAGE_DESCRIPTION
"Understory reads the raw recording of a handheld, backpack or machine-borne
scanner. It writes a trajectory, a map, a list of trees, and a report that
says what to trust.")
  include(CPack)
endif()
