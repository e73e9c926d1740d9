!> Facade of the HDF5 layer: files, datasets, attributes and datasets that grow.
module fw_hdf5
   use fw_hdf5_append, only: growing_dataset, growing_integer, growing_logical, growing_real
   use fw_hdf5_attribute, only: has_attribute, read_attribute, write_attribute
   use fw_hdf5_dataset, only: get_shape
   use fw_hdf5_file, only: dataset_failure, hdf5_file, shape_text
   use fw_hdf5_read, only: read_dataset
   use fw_hdf5_text, only: read_text, write_text
   use fw_hdf5_write, only: write_dataset
   implicit none (type, external)
   private

   public :: hdf5_file, get_shape, shape_text, dataset_failure
   public :: read_dataset, write_dataset, read_text, write_text
   public :: has_attribute, read_attribute, write_attribute
   public :: growing_dataset, growing_real, growing_integer, growing_logical

end module fw_hdf5
