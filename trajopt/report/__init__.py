"""Run folders, tables and pictures of any problem; drawn by matplotlib, which only this room and
pictures of systems import.

Public: ``run_folder.write_solution`` and ``read_solution``, ``pictures.save_pictures``.
"""
