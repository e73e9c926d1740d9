!> Whether a program links with the archives of what this one uses (ProgramArchives.cmake).
program archives
   use, intrinsic :: iso_c_binding, only: c_ptr
   use fcvode_mod, only: FCVodeCreate, CV_BDF
   use fkinsol_mod, only: FKINCreate
   use fsundials_context_mod, only: FSUNContext_Create
   use hdf5, only: h5open_f
   implicit none (type, external)
   type(c_ptr) :: context, memory
   integer :: status

   call h5open_f(status)
   status = FSUNContext_Create(memory, context)
   memory = FCVodeCreate(CV_BDF, context)
   memory = FKINCreate(context)
end program archives
