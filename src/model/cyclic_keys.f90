!> The keys of group &cyclic.
module fw_cyclic_keys
   use fw_cyclic_data, only: cyclic_type
   use fw_key, only: key, key_visitor
   use fw_key_range, only: dof_numbers, from_to
   implicit none (type, external)
   private

   public :: bind_sectors, bind_interfaces, no_order

   !> Stands for an engine order that is not given.
   integer, parameter :: no_order = huge(0)
   !> More sectors, or dofs of an interface, are taken for a mistake.
   integer, parameter :: most_sectors = 100000, most_dofs = 100000, most_order = 1000000

contains

   !> What makes a structure cyclic; 0 sectors and `no_order` stand for none.
   subroutine bind_sectors(keys, cyclic, needs_sectors, needs_order)
      class(key_visitor), intent(inout) :: keys
      type(cyclic_type), intent(inout) :: cyclic
      logical, intent(in) :: needs_sectors, needs_order

      call keys%open('cyclic', 'sectors around an axis and the wave that runs around it')
      call keys%bind(key('n_sectors', 'equal sectors, of which the model is one', &
                         from_to(1, most_sectors), absent='of the file, else not cyclic'), &
                     cyclic%n_sectors, needs_sectors)
      call keys%bind(key('engine_order', &
                         'each sector is this part of n_sectors periods behind the one before; '// &
                         'negative: ahead', from_to(-most_order, most_order), &
                         absent='required with sectors', &
                         only="cyclic, all but analysis = 'modes'"), cyclic%engine_order, &
                     needs_order)
      call keys%bind(key('mistuned', &
                         'solve all sectors; &contact takes n_pairs values, or n_sectors times '// &
                         'as many'), cyclic%is_mistuned)
      call keys%bind(key('n_modes', 'frequencies of each nodal diameter', from_to(1, most_dofs), &
                         only="analysis = 'modes'"), cyclic%n_modes)
   end subroutine bind_sectors

   !> The interfaces of a sector; what a model file holds is there already.
   subroutine bind_interfaces(keys, cyclic, n_interface, needed)
      class(key_visitor), intent(inout) :: keys
      type(cyclic_type), intent(inout) :: cyclic
      integer, intent(inout) :: n_interface
      !> The dofs are given nowhere else.
      logical, intent(in) :: needed

      call keys%bind(key('n_interface', &
                         'dofs of an interface; 0: contact alone joins the sectors', &
                         from_to(0, most_dofs), absent='of the file'), n_interface)
      call keys%set_size('n_interface', n_interface)
      call keys%bind(key('left', 'dofs of the left interface', dof_numbers(), shape='n_interface', &
                         repeats=.false., absent='of the file'), cyclic%left, &
                     needed .and. n_interface > 0)
      call keys%bind(key('right', &
                         'of the right one, which moves as the left one of the next sector; '// &
                         'negative: turned', dof_numbers(), shape='n_interface', repeats=.false., &
                         absent='of the file'), cyclic%right, needed .and. n_interface > 0)
   end subroutine bind_interfaces

end module fw_cyclic_keys
