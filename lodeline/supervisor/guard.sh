# The guard: a process that outlives the supervisor by some milliseconds, and kills what is left.
#
# It reads process groups from standard input (`+412` to watch one, `-412` to forget it) and at the
# end of that file, which is the supervisor's death or its goodbye, kills them all, and then becomes
# the program given as arguments, which looks for those that left their group.
# It is told each group after the fact, so children carry a parent-death signal besides. A shell
# waits in a tenth of the memory that a Python takes: it costs each pipeline a process.

trap '' INT TERM HUP
groups=' '
while read -r line; do
    group=${line#?}
    case $line in
        +*) groups="$groups$group " ;;
        *) case $groups in
            *" $group "*) groups="${groups%%" $group "*} ${groups#*" $group "}" ;;
        esac ;;
    esac
done
for group in $groups; do
    kill -s KILL -- "-$group" 2>/dev/null
done
exec "$@"
