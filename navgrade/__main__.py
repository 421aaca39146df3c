from navgrade.cli import main

main()
